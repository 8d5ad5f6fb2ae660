#include "thicklens/estimator/depth_flips.h"

#include <algorithm>
#include <utility>

#include "estimator/scene/blur_image.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/kernels/device.h"

namespace thicklens::estimator {
namespace {

// The noise that is taken where the photograph does not show it, and the least of 8 bits.
constexpr double kMinNoise = 0.29 / 255;
// Residuals near edges of the depth are above the noise also for the right map.
constexpr double kMaxOfNoise = 2;
constexpr double kMaxOfExcess = 0.35;
// Where two orders do about as well, as in a symmetric scene, the first is taken.
constexpr double kAboutAsWell = 1.1;

double ResidualOf(const BlurImage& image, model::DepthFlip flip, const EstimateInput& input,
                  const SolverRun& run) {
  EstimateInput tried;
  tried.image = image.image;
  tried.disparity = image.disparity;
  model::FlipDepth(flip, tried.disparity.width_px, &tried.disparity.disparity);
  tried.weights = input.weights;
  tried.transfer = input.transfer;
  SceneOptions options;
  options.falloff = false;
  SceneSummary summary;
  EstimateScene(tried, options, run, &summary);
  return summary.residual_rms;
}

}  // namespace

DepthFlipCheck CheckDepthFlips(const EstimateInput& input, const DepthFlipOptions& options) {
  const int threads = ResolveThreads(options.threads);
  const BlurImage image = BlurImageOf(input, options.falloff, threads);
  DepthFlipCheck check;
  check.noise_sigma =
      std::max(EncodedNoiseSigma(image.image, input.transfer).value_or(0), kMinNoise);
  SceneViewSink sink;  // only the residual is wanted
  sink.take = [](int, int, const model::LinearImage&, const std::vector<Confidence>&) {
    ThrowIfCancelled();
  };
  sink.wants_confidence = false;
  SolverRun run;
  run.threads = threads;
  run.memory_limit_mib = options.memory_limit_mib;
  run.sink = &sink;
  for (const model::DepthFlip flip : {model::DepthFlip::kNone, model::DepthFlip::kRows,
                                      model::DepthFlip::kColumns, model::DepthFlip::kBoth}) {
    check.trials.push_back({flip, ResidualOf(image, flip, input, run)});
  }
  const auto excess = [&](const DepthFlipTrial& trial) {
    return trial.residual_rms * trial.residual_rms - check.noise_sigma * check.noise_sigma;
  };
  const DepthFlipTrial& given = check.trials.front();
  const DepthFlipTrial* best = &check.trials[1];
  for (const DepthFlipTrial& trial : check.trials) {
    if (trial.residual_rms * kAboutAsWell < best->residual_rms) best = &trial;
  }
  if (best->residual_rms <= kMaxOfNoise * check.noise_sigma &&
      excess(*best) <= kMaxOfExcess * excess(given)) {
    check.better = *best;
  }
  return check;
}

}  // namespace thicklens::estimator
