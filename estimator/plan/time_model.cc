#include "thicklens/estimator/time_model.h"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <iterator>

#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

// The variance of the views' places along one axis, in view steps squared.
double VarianceOf(const Eigen::ArrayXd& weights) {
  const Eigen::ArrayXd places =
      Eigen::ArrayXd::LinSpaced(weights.size(), 0, static_cast<double>(weights.size() - 1));
  const double mean = (weights * places).sum();
  return (weights * (places - mean).square()).sum();
}

// The quantities that the time of each part of a run can depend on.
constexpr std::array kSetupTerms = {TimeModel::kStart,       TimeModel::kViews,
                                    TimeModel::kPixels,      TimeModel::kPixelsChannels,
                                    TimeModel::kPixelsViews, TimeModel::kPixelsViewsBlur};
constexpr std::array kSolveTerms = {TimeModel::kStart,
                                    TimeModel::kPixels,
                                    TimeModel::kPixelsChannels,
                                    TimeModel::kPixelsViews,
                                    TimeModel::kPixelsChannelsBlur,
                                    TimeModel::kPixelsViewsBlur,
                                    TimeModel::kPixelsViewsChannelsIterations,
                                    TimeModel::kPixelsChannelsIterations,
                                    TimeModel::kPixelsViewsBlurArea};
constexpr std::array kFilesTerms = {TimeModel::kStart, TimeModel::kViews, TimeModel::kPixelsViews,
                                    TimeModel::kFileSeconds};
constexpr std::array kRestTerms = {TimeModel::kStart,       TimeModel::kViews,
                                   TimeModel::kPixels,      TimeModel::kPixelsChannels,
                                   TimeModel::kPixelsViews, TimeModel::kPixelsViewsChannels};

TimeModel::Terms TermsOf(const Workload& load) {
  const double pixels = load.megapixels;
  const double blur = load.blur_sigma_px;
  TimeModel::Terms terms;
  terms[TimeModel::kStart] = 1;
  terms[TimeModel::kPixels] = pixels;
  terms[TimeModel::kPixelsChannels] = pixels * load.channels;
  terms[TimeModel::kPixelsViews] = pixels * load.views;
  terms[TimeModel::kPixelsViewsChannels] = pixels * load.views * load.channels;
  terms[TimeModel::kPixelsChannelsBlur] = pixels * load.channels * blur;
  terms[TimeModel::kPixelsViewsBlur] = pixels * load.views * blur;
  terms[TimeModel::kFileSeconds] = load.file_seconds;
  terms[TimeModel::kViews] = load.views;
  terms[TimeModel::kPixelsViewsChannelsIterations] =
      pixels * load.views * load.channels * blur / (1 + blur);
  terms[TimeModel::kPixelsChannelsIterations] = pixels * load.channels * blur / (0.2 + blur);
  terms[TimeModel::kPixelsViewsBlurArea] = pixels * load.views * blur * blur;
  return terms;
}

// A part of the time of some images, and the whole that its errors count against.
struct PartOfTime {
  std::vector<Workload> loads;
  std::vector<double> part, whole;

  void Add(const Workload& load, double part_seconds, double whole_seconds) {
    loads.push_back(load);
    part.push_back(part_seconds);
    whole.push_back(whole_seconds);
  }
};

// The best that is nowhere negative is the plain best of the terms that it uses: few terms, so all
// choices of them are tried.
template <std::size_t N>
TimeModel::Terms FitPart(const PartOfTime& time, const std::array<TimeModel::Term, N>& allowed) {
  const auto count = static_cast<Eigen::Index>(time.loads.size());
  Eigen::MatrixXd terms(count, TimeModel::kTerms);
  Eigen::VectorXd shares(count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    terms.row(i) = TermsOf(time.loads[at]) / time.whole[at];
    shares[i] = time.part[at] / time.whole[at];
  }
  TimeModel::Terms best = TimeModel::Terms::Zero();
  double least = shares.squaredNorm();
  for (unsigned choice = 1; choice < 1U << N; ++choice) {
    Eigen::MatrixXd of_choice(count, 0);
    std::vector<TimeModel::Term> used;
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

double RestSeconds(const TimedWorkload& load) {
  return load.seconds - load.parts.read - load.parts.setup - load.parts.solve - load.parts.files;
}

void CheckTimes(const TimesOfPlans& plans) {
  for (const std::vector<TimedWorkload>& plan : plans) {
    if (plan.size() < 2 || plan.size() != plans.front().size()) {
      throw Error(
          fmt::format("models of the run time need the same images for each plan, at least two; "
                      "there are {} and "
                      "{}",
                      plans.front().size(), plan.size()));
    }
    for (const TimedWorkload& load : plan) {
      const auto [read, setup, solve, files] = load.parts;
      if (!(load.seconds > 0) || !(read >= 0) || !(setup >= 0) || !(solve >= 0) || !(files >= 0) ||
          !(RestSeconds(load) >= 0)) {
        throw Error(fmt::format(
            "a model of the run time needs times above 0, and parts of them, found {} s "
            "(read), {} s (setup), {} s (solve) and {} s (files) of {} s",
            read, setup, solve, files, load.seconds));
      }
    }
  }
}

}  // namespace

Workload WorkloadOf(const EstimateInput& input, double file_seconds) {
  const DisparityMap& map = input.disparity;
  double square_sum = 0;
  for (const float disparity : map.disparity) {
    square_sum += static_cast<double>(disparity) * static_cast<double>(disparity);
  }
  const auto pixels = static_cast<double>(map.disparity.size());
  // A point lands in the view (a, b) at its disparity times the view's place; the views' weights
  // spread it in x and in y.
  const double spread_x = VarianceOf(input.weights.colwise().sum().transpose());
  const double spread_y = VarianceOf(input.weights.rowwise().sum());
  const double per_disparity =
      (map.step.x() * map.step.x() * spread_x + map.step.y() * map.step.y() * spread_y) / 2;
  Workload load;
  load.megapixels = 1e-6 * pixels;
  load.channels = input.image.channels;
  load.views = static_cast<int>(input.weights.size());
  load.blur_sigma_px = std::sqrt(square_sum / pixels * per_disparity);
  load.file_seconds = file_seconds;
  return load;
}

double TimeModel::Seconds(const Workload& load) const { return coefficients_.dot(TermsOf(load)); }

std::vector<TimeModel> FitTimeModels(const TimesOfPlans& plans) {
  if (plans.empty()) return {};
  CheckTimes(plans);
  const auto plan_count = static_cast<double>(plans.size());
  PartOfTime setup, files, rest;
  for (std::size_t i = 0; i < plans.front().size(); ++i) {
    PartSeconds mean;
    double mean_rest = 0, whole = 0;
    for (const std::vector<TimedWorkload>& plan : plans) {
      mean.setup += plan[i].parts.setup / plan_count;
      mean.files += plan[i].parts.files / plan_count;
      mean_rest += RestSeconds(plan[i]) / plan_count;
      whole += plan[i].seconds / plan_count;
    }
    const Workload& load = plans.front()[i].load;
    setup.Add(load, mean.setup, whole);
    files.Add(load, mean.files, whole);
    rest.Add(load, mean_rest, whole);
  }
  const TimeModel::Terms shared =
      FitPart(setup, kSetupTerms) + FitPart(files, kFilesTerms) + FitPart(rest, kRestTerms);
  std::vector<TimeModel> models;
  for (const std::vector<TimedWorkload>& plan : plans) {
    PartOfTime own;
    for (const TimedWorkload& load : plan) own.Add(load.load, load.parts.solve, load.seconds);
    models.emplace_back(shared + FitPart(own, kSolveTerms));
  }
  return models;
}

std::vector<std::vector<double>> LeftOutRatios(const TimesOfPlans& plans) {
  std::vector<std::vector<double>> ratios(plans.size());
  if (plans.empty()) return ratios;
  CheckTimes(plans);
  for (std::size_t i = 0; i < plans.front().size(); ++i) {
    const double left_out = plans.front()[i].load.megapixels;
    TimesOfPlans others;
    for (const std::vector<TimedWorkload>& plan : plans) {
      others.emplace_back();
      std::copy_if(plan.begin(), plan.end(), std::back_inserter(others.back()),
                   [&](const TimedWorkload& load) { return load.load.megapixels != left_out; });
    }
    const std::vector<TimeModel> models = FitTimeModels(others);
    for (std::size_t k = 0; k < plans.size(); ++k) {
      const TimedWorkload& timed = plans[k][i];
      ratios[k].push_back((timed.parts.read + models[k].Seconds(timed.load)) / timed.seconds);
    }
  }
  return ratios;
}

}  // namespace thicklens::estimator
