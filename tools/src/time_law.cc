#include "time_law.h"

#include <fmt/format.h>

#include <Eigen/QR>
#include <cmath>
#include <cstddef>
#include <limits>

#include "thicklens/error.h"

namespace thicklens::tools {
namespace {

TimeLaw::Terms TermsOf(const PictureLoad& load) {
  const double pixels = load.megapixels;
  TimeLaw::Terms terms;
  terms << 1, pixels, pixels * load.channels, pixels * load.views,
      pixels * load.views * load.channels, pixels * load.channels * load.blur_sigma_px,
      pixels * load.views * load.blur_sigma_px;
  return terms;
}

}  // namespace

double TimeLaw::Seconds(const PictureLoad& load) const { return coefficients_.dot(TermsOf(load)); }

TimeLaw FitTimeLaw(const std::vector<TimedLoad>& measured) {
  if (measured.size() < 2) {
    throw Error(fmt::format("a law of the time needs two pictures at least, there are {}",
                            measured.size()));
  }
  Eigen::MatrixXd terms(static_cast<Eigen::Index>(measured.size()), TimeLaw::kTerms);
  for (std::size_t i = 0; i < measured.size(); ++i) {
    if (!(measured[i].seconds > 0)) {
      throw Error(
          fmt::format("a law of the time needs times above 0, found {} s", measured[i].seconds));
    }
    terms.row(static_cast<Eigen::Index>(i)) = TermsOf(measured[i].load) / measured[i].seconds;
  }
  // The best that is nowhere negative is the plain best of the terms that it uses: few terms, so
  // all choices of them are tried.
  double least = std::numeric_limits<double>::infinity();
  TimeLaw::Terms best = TimeLaw::Terms::Zero();
  for (unsigned choice = 1; choice < 1U << TimeLaw::kTerms; ++choice) {
    Eigen::MatrixXd of_choice(terms.rows(), 0);
    std::vector<int> used;
    for (int i = 0; i < TimeLaw::kTerms; ++i) {
      if ((choice >> static_cast<unsigned>(i) & 1U) == 0) continue;
      of_choice.conservativeResize(Eigen::NoChange, of_choice.cols() + 1);
      of_choice.col(of_choice.cols() - 1) = terms.col(i);
      used.push_back(i);
    }
    const Eigen::VectorXd ones = Eigen::VectorXd::Ones(terms.rows());
    const Eigen::VectorXd found = of_choice.colPivHouseholderQr().solve(ones);
    if (!found.allFinite() || !(found.array() >= 0).all()) continue;
    const double error = (of_choice * found - ones).squaredNorm();
    if (!(error < least)) continue;
    least = error;
    best.setZero();
    for (std::size_t i = 0; i < used.size(); ++i) {
      best[used[i]] = found[static_cast<Eigen::Index>(i)];
    }
  }
  return TimeLaw(best);
}

std::vector<double> LeftOutRatios(const std::vector<TimedLoad>& measured) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < measured.size(); ++i) {
    std::vector<TimedLoad> others;
    for (std::size_t j = 0; j < measured.size(); ++j) {
      if (measured[j].load.megapixels != measured[i].load.megapixels) {
        others.push_back(measured[j]);
      }
    }
    ratios.push_back(FitTimeLaw(others).Seconds(measured[i].load) / measured[i].seconds);
  }
  return ratios;
}

}  // namespace thicklens::tools
