// Fits each side of focus alone.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/uncertainty/systematic_parts.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinOnASide = 6;

// Returns the samples on one side of focus, with the target's softness held at the value of the
// whole sweep.
std::optional<BlurFitSetup> SideOf(const BlurEvidence& evidence, const BlurFitResult& fit,
                                   bool nearer, std::size_t* frames) {
  BlurFitSetup setup = evidence.setup;
  setup.offset_mm.sigma = 0;  // it moves both sides alike
  if (!setup.floor_variance_px2)
    setup.floor_variance_px2 = model::Estimate{fit.values[kFloorVariance], 0};
  *frames = 0;
  for (std::size_t m = 0; m < setup.estimators.size(); ++m) {
    BlurSamples& estimator = setup.estimators[m];
    std::vector<Eigen::Index> kept;
    std::vector<std::size_t> kept_frames;
    for (std::size_t i = 0; i < estimator.frames.size(); ++i) {
      const double depth_mm =
          setup.offset_mm.value +
          model::DirectionSign(setup.direction) * setup.frames[estimator.frames[i]].reading_mm;
      if ((depth_mm < fit.values[kFocusDepth]) != nearer) continue;
      kept.push_back(static_cast<Eigen::Index>(i));
      kept_frames.push_back(estimator.frames[i]);
    }
    BlurSamples side;
    side.frames = kept_frames;
    side.variances_px2 = estimator.variances_px2(kept);
    side.covariance = estimator.covariance(kept, kept);
    side.held_softness_px2 = fit.softness_px2[m];
    estimator = std::move(side);
    *frames = std::max(*frames, kept.size());
  }
  setup.estimators.erase(std::remove_if(setup.estimators.begin(), setup.estimators.end(),
                                        [](const BlurSamples& m) { return m.frames.empty(); }),
                         setup.estimators.end());
  if (*frames < kMinOnASide) return std::nullopt;
  return setup;
}

SideFit FitSide(const BlurEvidence& evidence, const BlurFitResult& fit, bool nearer) {
  SideFit side;
  std::size_t frames = 0;
  const std::optional<BlurFitSetup> setup = SideOf(evidence, fit, nearer, &frames);
  side.frames_used = static_cast<int>(frames);
  if (!setup) {
    side.message =
        fmt::format("{} frames are on this side, but {} are needed", frames, kMinOnASide);
    return side;
  }
  const BlurFitResult alone = FitBlur(*setup, &fit);
  side.message = alone.message;
  if (!alone.done) return side;
  side.done = true;
  side.focus_depth_mm = {alone.values[kFocusDepth],
                         std::sqrt(alone.covariance(kFocusDepth, kFocusDepth))};
  side.blur_ratio = {alone.values[kBlurRatio], std::sqrt(alone.covariance(kBlurRatio, kBlurRatio))};
  return side;
}

}  // namespace

void FitSides(const BlurEvidence& evidence, const BlurFitResult& fit, Calibration* calibration) {
  calibration->diagnostics.nearer = FitSide(evidence, fit, true);
  calibration->diagnostics.farther = FitSide(evidence, fit, false);
}

}  // namespace thicklens::calib
