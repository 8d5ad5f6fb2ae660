#include "estimator/scene/blur_image.h"

#include <fmt/format.h>

#include <algorithm>

#include "estimator/scene/coarse_start.h"
#include "estimator/scene/scene_bands.h"
#include "estimator/scene/scene_memory.h"
#include "estimator/views/ray_landing.h"
#include "thicklens/base/error.h"
#include "thicklens/base/run_cost.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::estimator {
namespace {

// Halving the size leaves a quarter of the cost and half of the noise.
constexpr int kMinHalvedPx = 256;
constexpr double kMaxPixels = 1 << 20;
constexpr int kMinRows = 64;
constexpr int kSampleRows = 16;

bool IsToBeHalved(const model::LinearImage& image, int halvings) {
  return std::min(image.width_px, image.height_px) >= kMinHalvedPx &&
         (halvings == 0 || 1.0 * image.width_px * image.height_px > kMaxPixels);
}

void KeepMiddleRows(int rows, BlurImage* looked) {
  if (rows >= looked->image.height_px) return;
  const int from = (looked->image.height_px - rows) / 2;
  looked->clipped =
      CutRows(looked->clipped, looked->image.width_px, looked->image.channels, from, from + rows);
  looked->image = CutRows(looked->image, from, from + rows);
  looked->disparity = CutRows(looked->disparity, from, from + rows);
}

}  // namespace

BlurImage BlurImageOf(const EstimateInput& input, bool falloff, int threads) {
  std::optional<DisparityMap> of_pixels;
  std::optional<model::LinearImage> without_falloff;
  if (input.grid) {
    of_pixels = PhotographDisparity(input.disparity, LandingStepPx(*input.camera, *input.grid));
    if (falloff) {
      without_falloff = WithoutFalloff(input.image, *input.grid, input.camera_of_falloff(),
                                       input.weights, threads);
    }
  }
  const DisparityMap& disparity = of_pixels ? *of_pixels : input.disparity;
  const model::LinearImage& image = without_falloff ? *without_falloff : input.image;
  if (!IsToBeHalved(image, 0)) return {image, disparity, 0, input.clipped};
  const auto half_of = [](const ClippedValues& clipped, const model::LinearImage& of) {
    return HalfSize(clipped, of.width_px, of.height_px, of.channels);
  };
  BlurImage looked{HalfSize(image), HalfSize(disparity), 1, half_of(input.clipped, image)};
  while (IsToBeHalved(looked.image, looked.halvings)) {
    looked.clipped = half_of(looked.clipped, looked.image);
    looked.image = HalfSize(looked.image);
    looked.disparity = HalfSize(looked.disparity);
    ++looked.halvings;
  }
  return looked;
}

SceneProjection<float> ProjectionWithin(const Eigen::ArrayXXd& weights,
                                        std::optional<double> memory_limit_mib,
                                        const ProjectionOptions& options, BlurImage* image) {
  const auto make = [&](const BlurImage& of) {
    return MakeSceneProjection<float>(of.disparity, weights, options);
  };
  const auto bytes_of = [](const SceneProjection<float>& made) {
    return ProjectionBytes{made.bytes(0, made.height_px), made.bundle_bytes};
  };
  if (!memory_limit_mib) return make(*image);
  const int width_px = image->image.width_px, height_px = image->image.height_px;
  EstimateInput forecast;
  forecast.image = {width_px, height_px, image->image.channels, {}};
  forecast.weights = weights;
  ReturnFreedMemory(memory_limit_mib);
  const SceneMemory memory(forecast, SceneOptions(), options.threads, {},
                           ReachPx(image->disparity, 0, static_cast<int>(weights.rows())));
  const auto fits = [&](int rows, const ProjectionBytes& projection) {
    return memory.MostBytes(rows, projection) <= *memory_limit_mib * kBytesPerMib;
  };
  BlurImage sample = *image;
  KeepMiddleRows(kSampleRows, &sample);
  const auto of_row = [](const ProjectionBytes& all, int rows) {
    return ProjectionBytes{all.held / rows, all.bundle / rows};
  };
  ProjectionBytes per_row = of_row(bytes_of(make(sample)), sample.image.height_px);
  // Where rows are few, most rays pass the upper or the lower border, where they are hidden.
  per_row.bundle = static_cast<double>((weights > 0).count()) * width_px * sizeof(float);
  for (int rows = height_px; rows >= std::min(kMinRows, height_px); rows = rows * 7 / 8) {
    if (!fits(rows, {rows * per_row.held, rows * per_row.bundle})) continue;
    KeepMiddleRows(rows, image);
    SceneProjection<float> made = make(*image);
    if (fits(rows, bytes_of(made))) return made;
    per_row = of_row(bytes_of(made), rows);
  }
  throw Error(
      fmt::format("memory_limit_mib is {:g}: it is too low to check the blur on {} rows of {} px",
                  *memory_limit_mib, std::min(kMinRows, height_px), width_px));
}

}  // namespace thicklens::estimator
