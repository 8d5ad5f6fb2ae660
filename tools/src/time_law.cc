#include "time_law.h"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cstddef>
#include <iterator>

#include "thicklens/error.h"

namespace thicklens::tools {
namespace {

TimeLaw::Terms TermsOf(const PictureLoad& load) {
  const double pixels = load.megapixels;
  TimeLaw::Terms terms;
  terms << 1, pixels, pixels * load.channels, pixels * load.views,
      pixels * load.views * load.channels, pixels * load.channels * load.blur_sigma_px,
      pixels * load.views * load.blur_sigma_px, load.file_seconds;
  return terms;
}

// A part of the time of some pictures, and the whole that its errors count against.
struct PartOfTime {
  std::vector<PictureLoad> loads;
  std::vector<double> part, whole;

  void Add(const PictureLoad& load, double part_seconds, double whole_seconds) {
    loads.push_back(load);
    part.push_back(part_seconds);
    whole.push_back(whole_seconds);
  }
};

// The best that is nowhere negative is the plain best of the terms that it uses: few terms, so all
// choices of them are tried.
TimeLaw::Terms FitPart(const PartOfTime& time) {
  const auto count = static_cast<Eigen::Index>(time.loads.size());
  Eigen::MatrixXd terms(count, TimeLaw::kTerms);
  Eigen::VectorXd shares(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    terms.row(i) = TermsOf(time.loads[at]) / time.whole[at];
    shares[i] = time.part[at] / time.whole[at];
  }
  TimeLaw::Terms best = TimeLaw::Terms::Zero();
  double least = shares.squaredNorm();
  for (unsigned choice = 1; choice < 1U << TimeLaw::kTerms; ++choice) {
    Eigen::MatrixXd of_choice(count, 0);
    std::vector<int> used;
    for (int i = 0; i < TimeLaw::kTerms; ++i) {
      if ((choice >> static_cast<unsigned>(i) & 1U) == 0) continue;
      of_choice.conservativeResize(Eigen::NoChange, of_choice.cols() + 1);
      of_choice.col(of_choice.cols() - 1) = terms.col(i);
      used.push_back(i);
    }
    const Eigen::VectorXd found = of_choice.colPivHouseholderQr().solve(shares);
    if (!found.allFinite() || !(found.array() >= 0).all()) continue;
    const double error = (of_choice * found - shares).squaredNorm();
    if (!(error < least)) continue;
    least = error;
    best.setZero();
    for (std::size_t i = 0; i < used.size(); ++i) {
      best[used[i]] = found[static_cast<Eigen::Index>(i)];
    }
  }
  return best;
}

void CheckTimes(const TimesOfPlans& plans) {
  for (const std::vector<TimedLoad>& plan : plans) {
    if (plan.size() < 2 || plan.size() != plans.front().size()) {
      throw Error(fmt::format(
          "laws of the time need the same pictures for each plan, two at least; there are {} and "
          "{}",
          plans.front().size(), plan.size()));
    }
    for (const TimedLoad& load : plan) {
      if (!(load.seconds > 0) || !(load.solve_seconds >= 0) ||
          !(load.solve_seconds <= load.seconds)) {
        throw Error(
            fmt::format("a law of the time needs times above 0, and parts of them, found {} s of "
                        "{} s",
                        load.solve_seconds, load.seconds));
      }
    }
  }
}

}  // namespace

double TimeLaw::Seconds(const PictureLoad& load) const { return coefficients_.dot(TermsOf(load)); }

std::vector<TimeLaw> FitTimeLaws(const TimesOfPlans& plans) {
  if (plans.empty()) return {};
  CheckTimes(plans);
  const auto plan_count = static_cast<double>(plans.size());
  PartOfTime common;
  for (std::size_t i = 0; i < plans.front().size(); ++i) {
    double rest = 0, whole = 0;
    for (const std::vector<TimedLoad>& plan : plans) {
      rest += plan[i].seconds - plan[i].solve_seconds;
      whole += plan[i].seconds;
    }
    common.Add(plans.front()[i].load, rest / plan_count, whole / plan_count);
  }
  const TimeLaw::Terms shared = FitPart(common);
  std::vector<TimeLaw> laws;
  for (const std::vector<TimedLoad>& plan : plans) {
    PartOfTime own;
    for (const TimedLoad& load : plan) own.Add(load.load, load.solve_seconds, load.seconds);
    laws.emplace_back(shared + FitPart(own));
  }
  return laws;
}

std::vector<std::vector<double>> LeftOutRatios(const TimesOfPlans& plans) {
  std::vector<std::vector<double>> ratios(plans.size());
  if (plans.empty()) return ratios;
  CheckTimes(plans);
  for (std::size_t i = 0; i < plans.front().size(); ++i) {
    const double left_out = plans.front()[i].load.megapixels;
    TimesOfPlans others;
    for (const std::vector<TimedLoad>& plan : plans) {
      others.emplace_back();
      std::copy_if(plan.begin(), plan.end(), std::back_inserter(others.back()),
                   [&](const TimedLoad& load) { return load.load.megapixels != left_out; });
    }
    const std::vector<TimeLaw> laws = FitTimeLaws(others);
    for (std::size_t k = 0; k < plans.size(); ++k) {
      ratios[k].push_back(laws[k].Seconds(plans[k][i].load) / plans[k][i].seconds);
    }
  }
  return ratios;
}

}  // namespace thicklens::tools
