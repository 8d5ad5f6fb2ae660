#include "estimator/views/warped_views.h"

#include <cstddef>
#include <utility>
#include <vector>

#include "estimator/views/input_checks.h"
#include "estimator/views/ray_irradiance.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {
model::LinearImage WithoutFalloff(const model::LinearImage& photograph,
                                  const model::LightFieldGrid& grid, const model::Camera& camera,
                                  const Eigen::ArrayXXd& weights, int threads) {
  const std::vector<float> share =
      FalloffOfImage(grid, camera, weights, photograph.width_px, photograph.height_px, threads);
  model::LinearImage radiance = photograph;
  for (std::size_t i = 0; i < radiance.values.size(); ++i) {
    radiance.values[i] /= share[i / Index(radiance.channels)];
  }
  return radiance;
}

model::LightField WarpToAllViews(const EstimateInput& input, bool falloff, int threads,
                                 std::vector<std::vector<float>>* disparity) {
  model::LightField warped = FrameOf(input);
  const model::LinearImage radiance =
      falloff && input.camera ? WithoutFalloff(input.image, *input.grid, input.camera_of_falloff(),
                                               input.weights, threads)
                              : input.image;
  const DisparityRenderer renderer(input.disparity);
  const ImageWarper warper(radiance, input.disparity);
  const int views = warped.u_count * warped.v_count;
  if (disparity != nullptr) disparity->resize(Index(views));
  ParallelFor(views, threads, [&](int view) {
    const int k = view % warped.u_count;
    const int l = view / warped.u_count;
    ViewDisparity shown = renderer.Render(warped.u_offset(k), warped.v_offset(l));
    model::SetView(&warped, k, l, warper.Warp(shown));
    if (disparity != nullptr) (*disparity)[Index(view)] = std::move(shown.disparity);
  });
  warped.origin.method = "dibr";
  return warped;
}

model::LightField WarpedLightField(const EstimateInput& input, bool falloff, int threads) {
  return WarpToAllViews(input, falloff, threads, nullptr);
}

}  // namespace thicklens::estimator
