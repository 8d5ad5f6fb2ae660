#include "tools/options/time_law.h"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>

#include "thicklens/base/error.h"

namespace thicklens::tools {
namespace {

// The terms that the parts of a run can depend on.
constexpr std::array kSetupTerms = {TimeLaw::kStart,       TimeLaw::kViews,
                                    TimeLaw::kPixels,      TimeLaw::kPixelsChannels,
                                    TimeLaw::kPixelsViews, TimeLaw::kPixelsViewsBlur};
constexpr std::array kSolveTerms = {TimeLaw::kStart,
                                    TimeLaw::kPixels,
                                    TimeLaw::kPixelsChannels,
                                    TimeLaw::kPixelsViews,
                                    TimeLaw::kPixelsChannelsBlur,
                                    TimeLaw::kPixelsViewsBlur,
                                    TimeLaw::kPixelsViewsChannelsIterations,
                                    TimeLaw::kPixelsChannelsIterations,
                                    TimeLaw::kPixelsViewsBlurArea};
constexpr std::array kFilesTerms = {TimeLaw::kStart, TimeLaw::kViews, TimeLaw::kPixelsViews,
                                    TimeLaw::kFileSeconds};
constexpr std::array kRestTerms = {TimeLaw::kStart,       TimeLaw::kViews,
                                   TimeLaw::kPixels,      TimeLaw::kPixelsChannels,
                                   TimeLaw::kPixelsViews, TimeLaw::kPixelsViewsChannels};

TimeLaw::Terms TermsOf(const PictureLoad& load) {
  const double pixels = load.megapixels;
  const double blur = load.blur_sigma_px;
  TimeLaw::Terms terms;
  terms[TimeLaw::kStart] = 1;
  terms[TimeLaw::kPixels] = pixels;
  terms[TimeLaw::kPixelsChannels] = pixels * load.channels;
  terms[TimeLaw::kPixelsViews] = pixels * load.views;
  terms[TimeLaw::kPixelsViewsChannels] = pixels * load.views * load.channels;
  terms[TimeLaw::kPixelsChannelsBlur] = pixels * load.channels * blur;
  terms[TimeLaw::kPixelsViewsBlur] = pixels * load.views * blur;
  terms[TimeLaw::kFileSeconds] = load.file_seconds;
  terms[TimeLaw::kViews] = load.views;
  terms[TimeLaw::kPixelsViewsChannelsIterations] =
      pixels * load.views * load.channels * blur / (1 + blur);
  terms[TimeLaw::kPixelsChannelsIterations] = pixels * load.channels * blur / (0.2 + blur);
  terms[TimeLaw::kPixelsViewsBlurArea] = pixels * load.views * blur * blur;
  return terms;
}

// A part of the time for some pictures, with the whole time that its errors are relative to.
struct PartOfTime {
  std::vector<PictureLoad> loads;
  std::vector<double> part, whole;

  void Add(const PictureLoad& load, double part_seconds, double whole_seconds) {
    loads.push_back(load);
    part.push_back(part_seconds);
    whole.push_back(whole_seconds);
  }
};

// The best fit without negative coefficients equals the unconstrained fit of the terms that it
// uses: there are few terms, so all subsets of them are tried.
template <std::size_t N>
TimeLaw::Terms FitPart(const PartOfTime& time, const std::array<TimeLaw::Term, N>& allowed) {
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
  for (unsigned choice = 1; choice < 1U << N; ++choice) {
    Eigen::MatrixXd of_choice(count, 0);
    std::vector<TimeLaw::Term> used;
    for (unsigned i = 0; i < N; ++i) {
      if ((choice >> i & 1U) == 0) continue;
      of_choice.conservativeResize(Eigen::NoChange, of_choice.cols() + 1);
      of_choice.col(of_choice.cols() - 1) = terms.col(allowed[i]);
      used.push_back(allowed[i]);
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

double RestSeconds(const TimedLoad& load) {
  return load.seconds - load.parts.read - load.parts.setup - load.parts.solve - load.parts.files;
}

void CheckTimes(const TimesOfPlans& plans) {
  for (const std::vector<TimedLoad>& plan : plans) {
    if (plan.size() < 2 || plan.size() != plans.front().size()) {
      throw Error(
          fmt::format("models of the run time need the same pictures for each plan, at least two; "
                      "there are {} and "
                      "{}",
                      plans.front().size(), plan.size()));
    }
    for (const TimedLoad& load : plan) {
      const auto [read, setup, solve, files] = load.parts;
      if (!(load.seconds > 0) || !(read >= 0) || !(setup >= 0) || !(solve >= 0) || !(files >= 0) ||
          !(RestSeconds(load) >= 0)) {
        throw Error(
            fmt::format("a model of the run time needs times above 0, and parts of them, found {} "
                        "s (read), {} s (setup), {} s (solve) and {} s (files) of {} s",
                        read, setup, solve, files, load.seconds));
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
  PartOfTime setup, files, rest;
  for (std::size_t i = 0; i < plans.front().size(); ++i) {
    PartSeconds mean;
    double mean_rest = 0, whole = 0;
    for (const std::vector<TimedLoad>& plan : plans) {
      mean.setup += plan[i].parts.setup / plan_count;
      mean.files += plan[i].parts.files / plan_count;
      mean_rest += RestSeconds(plan[i]) / plan_count;
      whole += plan[i].seconds / plan_count;
    }
    const PictureLoad& load = plans.front()[i].load;
    setup.Add(load, mean.setup, whole);
    files.Add(load, mean.files, whole);
    rest.Add(load, mean_rest, whole);
  }
  const TimeLaw::Terms shared =
      FitPart(setup, kSetupTerms) + FitPart(files, kFilesTerms) + FitPart(rest, kRestTerms);
  std::vector<TimeLaw> laws;
  for (const std::vector<TimedLoad>& plan : plans) {
    PartOfTime own;
    for (const TimedLoad& load : plan) own.Add(load.load, load.parts.solve, load.seconds);
    laws.emplace_back(shared + FitPart(own, kSolveTerms));
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
      const TimedLoad& timed = plans[k][i];
      ratios[k].push_back((timed.parts.read + laws[k].Seconds(timed.load)) / timed.seconds);
    }
  }
  return ratios;
}

}  // namespace thicklens::tools
