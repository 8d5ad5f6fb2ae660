#include "estimator/scene/blur_picture.h"

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
constexpr int kLeastHalvedPx = 256;
constexpr double kMostPixels = 1 << 20;
constexpr int kLeastRows = 64;
constexpr int kSampleRows = 16;

bool IsToBeHalved(const model::LinearPicture& picture, int halvings) {
  return std::min(picture.width_px, picture.height_px) >= kLeastHalvedPx &&
         (halvings == 0 || 1.0 * picture.width_px * picture.height_px > kMostPixels);
}

void KeepMiddleRows(int rows, BlurPicture* looked) {
  if (rows >= looked->picture.height_px) return;
  const int from = (looked->picture.height_px - rows) / 2;
  looked->picture = CutRows(looked->picture, from, from + rows);
  looked->disparity = CutRows(looked->disparity, from, from + rows);
}

}  // namespace

BlurPicture BlurPictureOf(const EstimateInput& input, bool falloff, int threads) {
  std::optional<DisparityMap> of_pixels;
  std::optional<model::LinearPicture> without_falloff;
  if (input.grid) {
    of_pixels = PhotographDisparity(input.disparity, LandingStepPx(*input.camera, *input.grid));
    if (falloff) {
      without_falloff = WithoutFalloff(input.picture, *input.grid, input.camera_of_falloff(),
                                       input.weights, threads);
    }
  }
  const DisparityMap& disparity = of_pixels ? *of_pixels : input.disparity;
  const model::LinearPicture& picture = without_falloff ? *without_falloff : input.picture;
  if (!IsToBeHalved(picture, 0)) return {picture, disparity, 0};
  BlurPicture looked{HalfSize(picture), HalfSize(disparity), 1};
  while (IsToBeHalved(looked.picture, looked.halvings)) {
    looked.picture = HalfSize(looked.picture);
    looked.disparity = HalfSize(looked.disparity);
    ++looked.halvings;
  }
  return looked;
}

SceneProjection<float> ProjectionWithin(const Eigen::ArrayXXd& weights,
                                        std::optional<double> memory_limit_mib,
                                        const ProjectionOptions& options, BlurPicture* picture) {
  const auto make = [&](const BlurPicture& of) {
    return MakeSceneProjection<float>(of.disparity, weights, options);
  };
  const auto bytes_of = [](const SceneProjection<float>& made) {
    return ProjectionBytes{made.bytes(0, made.height_px), made.fan_bytes};
  };
  if (!memory_limit_mib) return make(*picture);
  const int width_px = picture->picture.width_px, height_px = picture->picture.height_px;
  EstimateInput forecast;
  forecast.picture = {width_px, height_px, picture->picture.channels, {}};
  forecast.weights = weights;
  SceneOptions scene;
  scene.threads = options.threads;
  ReturnFreedMemory(memory_limit_mib);
  const SceneMemory memory(forecast, scene, {},
                           ReachPx(picture->disparity, 0, static_cast<int>(weights.rows())));
  const auto fits = [&](int rows, const ProjectionBytes& projection) {
    return memory.MostBytes(rows, projection) <= *memory_limit_mib * kBytesPerMib;
  };
  BlurPicture sample = *picture;
  KeepMiddleRows(kSampleRows, &sample);
  const auto of_row = [](const ProjectionBytes& all, int rows) {
    return ProjectionBytes{all.held / rows, all.fan / rows};
  };
  ProjectionBytes per_row = of_row(bytes_of(make(sample)), sample.picture.height_px);
  // Where rows are few, most rays pass the upper or the lower border, where they are hidden.
  per_row.fan = static_cast<double>((weights > 0).count()) * width_px * sizeof(float);
  for (int rows = height_px; rows >= std::min(kLeastRows, height_px); rows = rows * 7 / 8) {
    if (!fits(rows, {rows * per_row.held, rows * per_row.fan})) continue;
    KeepMiddleRows(rows, picture);
    SceneProjection<float> made = make(*picture);
    if (fits(rows, bytes_of(made))) return made;
    per_row = of_row(bytes_of(made), rows);
  }
  throw Error(
      fmt::format("memory_limit_mib is {:g}: it is too low to check the blur on {} rows of {} px",
                  *memory_limit_mib, std::min(kLeastRows, height_px), width_px));
}

}  // namespace thicklens::estimator
