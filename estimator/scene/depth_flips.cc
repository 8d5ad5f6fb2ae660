#include "thicklens/estimator/depth_flips.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/scene/blur_image.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {
namespace {

// The noise where the photograph does not show it, and the least: the rounding of 8 bits.
constexpr double kMinNoise = 0.29 / 255;
// Residuals near edges of the depth are above the noise also for the right map.
constexpr double kMaxOfNoise = 2;
constexpr double kMaxOfExcess = 0.35;
// Where two orders do about as well, as in a symmetric scene, the first is taken.
constexpr double kAboutAsWell = 1.1;

double ResidualOf(const BlurImage& image, model::DepthFlip flip, const EstimateInput& input,
                  double photo_aperture, const SolverRun& run) {
  EstimateInput tried;
  tried.image = image.image;
  tried.clipped = image.clipped;
  tried.disparity = image.disparity;
  model::FlipDepth(flip, tried.disparity.width_px, &tried.disparity.disparity);
  tried.weights = input.weights;
  tried.transfer = input.transfer;
  SceneOptions options;
  options.falloff = false;
  options.photo_aperture = photo_aperture;
  SceneSummary summary;
  EstimateScene(tried, options, run, &summary);
  return summary.residual_rms;
}

}  // namespace

std::optional<DepthFlipTrial> BetterFlip(const std::vector<DepthFlipTrial>& trials,
                                         double noise_sigma) {
  if (trials.size() < 2) return std::nullopt;
  const auto excess = [&](const DepthFlipTrial& trial) {
    return trial.residual_rms * trial.residual_rms - noise_sigma * noise_sigma;
  };
  const DepthFlipTrial& given = trials.front();
  if (!(excess(given) > 0)) return std::nullopt;
  auto best = trials.begin() + 1;
  for (auto trial = best; trial != trials.end(); ++trial) {
    if (trial->residual_rms * kAboutAsWell < best->residual_rms) best = trial;
  }
  const bool is_better = best->residual_rms <= kMaxOfNoise * noise_sigma &&
                         excess(*best) <= kMaxOfExcess * excess(given);
  return is_better ? std::optional(*best) : std::nullopt;
}

DepthFlipCheck CheckDepthFlips(const EstimateInput& input, const DepthFlipOptions& options) {
  const int threads = ResolveThreads(options.threads);
  const BlurImage image = BlurImageOf(input, options.falloff, threads);
  DepthFlipCheck check;
  const double noise_sigma = std::max(
      EncodedNoiseSigma(image.image, input.transfer, image.clipped).value_or(0), kMinNoise);
  // The mean of four pixels has half of an error that is white.
  check.noise_sigma =
      std::hypot(noise_sigma, std::ldexp(options.compression_sigma, -image.halvings));
  SceneViewSink sink;  // only the residual is wanted
  sink.wants_confidence = false;
  sink.wants_views = false;
  SolverRun run;
  run.threads = threads;
  run.memory_limit_mib = options.memory_limit_mib;
  run.sink = &sink;
  for (const model::DepthFlip flip : {model::DepthFlip::kNone, model::DepthFlip::kRows,
                                      model::DepthFlip::kColumns, model::DepthFlip::kBoth}) {
    check.trials.push_back({flip, ResidualOf(image, flip, input, options.photo_aperture, run)});
  }
  check.better = BetterFlip(check.trials, check.noise_sigma);
  return check;
}

}  // namespace thicklens::estimator
