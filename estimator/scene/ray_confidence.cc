#include "thicklens/estimator/ray_confidence.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

#include "estimator/projection/angular_bundle.h"
#include "estimator/projection/scene_projection.h"
#include "estimator/projection/separable_mask.h"
#include "estimator/projection/visible_fraction.h"
#include "estimator/scene/scene_data.h"
#include "estimator/views/input_checks.h"
#include "estimator/views/ray_landing.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/estimate_checks.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {
namespace {

constexpr Confidence kMinUnresolved = 1, kMinResolved = 129;
constexpr int kShares = 126;  // steps from the minimum to the maximum of either kind

}  // namespace

Confidence ConfidenceOfPoint(double visible_fraction, double blur_sigma_px) {
  const int least = blur_sigma_px > kUnresolvedBlurSigmaPx ? kMinUnresolved : kMinResolved;
  return static_cast<Confidence>(least +
                                 std::lround(std::clamp(visible_fraction, 0.0, 1.0) * kShares));
}

double VisibleFractionOf(Confidence confidence) {
  if (confidence == kFilledIn) return 0;
  const int least = IsResolved(confidence) ? kMinResolved : kMinUnresolved;
  return (confidence - least) / static_cast<double>(kShares);
}

bool IsResolved(Confidence confidence) { return confidence >= kMinResolved; }

ConfidenceShares SharesOf(const std::array<std::size_t, 256>& counts) {
  constexpr double kWhollyVisible = 0.99;
  ConfidenceShares shares;
  const double all =
      static_cast<double>(std::accumulate(counts.begin(), counts.end(), std::size_t{0}));
  for (std::size_t value = 0; value < counts.size(); ++value) {
    if (counts[value] == 0) continue;
    const auto confidence = static_cast<Confidence>(value);
    double* share = &shares.partly_visible;
    if (confidence == kFilledIn) {
      share = &shares.filled_in;
    } else if (!IsResolved(confidence)) {
      share = &shares.blurred;
    } else if (VisibleFractionOf(confidence) > kWhollyVisible) {
      share = &shares.visible;
    }
    *share += static_cast<double>(counts[value]) / all;
  }
  return shares;
}

std::vector<Confidence> PointConfidence(const EstimateInput& input, int threads) {
  CheckInput(input);
  DisparityMap disparity = input.disparity;
  if (input.grid) {
    disparity = PhotographDisparity(disparity, LandingStepPx(*input.camera, *input.grid));
  }
  threads = ResolveThreads(threads);
  const AngularBundle bundle = RenderBundle(disparity, input.weights, threads, nullptr);
  const SeparableMask plain =
      FindSeparablePixels(disparity, static_cast<int>(input.weights.cols()),
                          static_cast<int>(input.weights.rows()), ProjectionOptions().tolerance_px);
  const std::vector<float> visible = VisibleFraction(bundle, disparity, plain.is_visible, threads);
  const std::vector<float> blur_sigma_px = BlurSigmaPx(disparity, input.weights);
  std::vector<Confidence> confidence(visible.size());
  for (std::size_t i = 0; i < visible.size(); ++i) {
    confidence[i] =
        ConfidenceOfPoint(static_cast<double>(visible[i]), static_cast<double>(blur_sigma_px[i]));
  }
  return confidence;
}

std::vector<Confidence> RayConfidence(const std::vector<Confidence>& of_points,
                                      const CompactView& view) {
  std::vector<Confidence> confidence(view.disparity.size());
  const auto width = static_cast<std::size_t>(view.width_px);
  const auto shift_x = static_cast<float>(view.shift.x());
  const auto shift_y = static_cast<float>(view.shift.y());
  for (int y = 0; y < view.height_px; ++y) {
    ThrowIfCancelled();
    const std::size_t row = static_cast<std::size_t>(y) * width;
    for (int x = 0; x < view.width_px; ++x) {
      const std::size_t i = row + static_cast<std::size_t>(x);
      // A library call of lround would take as long as the rest of the loop. NaN becomes the first
      // sample.
      const auto nearest = [](int sample, float way, int count) {
        const float at = static_cast<float>(sample) + way + 0.5F;
        const auto last = static_cast<float>(count - 1);
        return static_cast<std::size_t>(at > 0 ? (at < last ? at : last) : 0.0F);
      };
      confidence[i] = of_points[nearest(y, shift_y * view.disparity[i], view.height_px) * width +
                                nearest(x, shift_x * view.disparity[i], view.width_px)];
    }
  }
  for (const CompactView::Occluded& occluded : view.occluded) {
    confidence[static_cast<std::size_t>(occluded.index)] = kFilledIn;
  }
  return confidence;
}

}  // namespace thicklens::estimator
