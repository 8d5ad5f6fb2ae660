#include "benchmarks/accuracy/summary.h"

#include <cmath>

#include "support/sample_statistics.h"

namespace thicklens::accuracy {
namespace {

using testing::BinomialTestP;
using testing::Median;
using testing::Quantile;
using testing::RobustSigmaAboutZero;
using testing::RootMeanSquare;

constexpr double kLevel = 0.95;
constexpr double kInterval = 1.96;  // this many sigmas contain kLevel of a Gaussian

Coverage Cover(const std::vector<Measured>& results) {
  Coverage coverage;
  coverage.trials = static_cast<int>(results.size());
  if (results.empty()) return coverage;
  std::vector<double> errors, sigmas, z;
  for (const Measured& result : results) {
    errors.push_back(result.error);
    sigmas.push_back(result.sigma);
    z.push_back(result.z());
    if (std::abs(result.z()) <= kInterval) ++coverage.inside;
  }
  coverage.binomial_p = BinomialTestP(coverage.inside, coverage.trials, kLevel);
  coverage.sigma_ratio = Median(sigmas) / RobustSigmaAboutZero(errors);
  coverage.sigma_ratio_z = 1 / RobustSigmaAboutZero(z);
  coverage.rms_z = RootMeanSquare(z);
  const auto count = static_cast<double>(z.size());
  for (const double value : z) coverage.mean_z += value / count;
  double variance = 0;
  for (const double value : z) variance += std::pow(value - coverage.mean_z, 2) / (count - 1);
  coverage.mean_over_error = coverage.mean_z / std::sqrt(variance / count);
  return coverage;
}

}  // namespace

Summary Summarise(const std::vector<const Trial*>& trials) {
  Summary summary;
  std::vector<Measured> focus, distance, ratio;
  std::vector<double> focus_mm, focus_steps, distance_um, relative, floors, recipe, beside_recipe;
  for (const Trial* trial : trials) {
    ++summary.trials;
    summary.mean_seconds += trial->seconds / static_cast<double>(trials.size());
    if (!trial->done) {
      ++summary.refusals[trial->reason];
      continue;
    }
    ++summary.done;
    if (trial->partial) ++summary.partial;
    focus.push_back(trial->focus_depth_mm);
    distance.push_back(trial->image_distance_mm);
    ratio.push_back(trial->blur_ratio);
    focus_mm.push_back(std::abs(trial->focus_depth_mm.error));
    focus_steps.push_back(focus_mm.back() / trial->step_mm);
    distance_um.push_back(1000 * std::abs(trial->image_distance_mm.error));
    relative.push_back(std::abs(trial->blur_ratio.error) / trial->true_blur_ratio);
    if (trial->floor == Floor::kMeasured && trial->blur_floor_px)
      floors.push_back(std::abs(trial->blur_floor_px->error));
    if (trial->recipe_error_mm) {
      recipe.push_back(std::abs(*trial->recipe_error_mm));
      beside_recipe.push_back(focus_mm.back());
    }
  }
  summary.focus_median_mm = Median(focus_mm);
  summary.focus_90_mm = Quantile(focus_mm, 0.9);
  summary.focus_median_steps = Median(focus_steps);
  summary.focus_90_steps = Quantile(focus_steps, 0.9);
  summary.image_distance_median_um = Median(distance_um);
  summary.image_distance_90_um = Quantile(distance_um, 0.9);
  summary.blur_ratio_median = Median(relative);
  summary.blur_ratio_90 = Quantile(relative, 0.9);
  if (!floors.empty()) summary.floor_90_px = Quantile(floors, 0.9);
  if (!recipe.empty()) {
    summary.recipe_median_mm = Median(recipe);
    summary.recipe_over_focus = Median(recipe) / Median(beside_recipe);
  }
  summary.focus_depth = Cover(focus);
  summary.image_distance = Cover(distance);
  summary.blur_ratio = Cover(ratio);
  return summary;
}

Coverage Pooled(const std::vector<Coverage>& coverages) {
  Coverage pooled;
  for (const Coverage& coverage : coverages) {
    pooled.inside += coverage.inside;
    pooled.trials += coverage.trials;
  }
  pooled.binomial_p = BinomialTestP(pooled.inside, pooled.trials, kLevel);
  return pooled;
}

}  // namespace thicklens::accuracy
