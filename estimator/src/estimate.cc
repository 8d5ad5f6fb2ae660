#include "thicklens/estimator/estimate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "estimate_input.h"
#include "ray_irradiance.h"
#include "thicklens/error.h"
#include "thicklens/model/parallel.h"
#include "warped_views.h"

namespace thicklens::estimator {
namespace {

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

}  // namespace

model::LinearPicture WithoutFalloff(const model::LinearPicture& photograph,
                                    const model::LightFieldGrid& grid, const model::Camera& camera,
                                    const Eigen::ArrayXXd& weights, int threads) {
  const std::vector<float> share =
      FalloffOfPicture(grid, camera, weights, photograph.width_px, photograph.height_px, threads);
  model::LinearPicture radiance = photograph;
  for (std::size_t i = 0; i < radiance.values.size(); ++i) {
    radiance.values[i] /= share[i / Index(radiance.channels)];
  }
  return radiance;
}

model::LightField WarpToAllViews(const EstimateInput& input, bool falloff, int threads,
                                 std::vector<std::vector<float>>* disparity) {
  model::LightField warped = FrameOf(input);
  const model::LinearPicture radiance =
      falloff && input.camera ? WithoutFalloff(input.picture, *input.grid,
                                               input.camera_of_falloff(), input.weights, threads)
                              : input.picture;
  const DisparityRenderer renderer(input.disparity);
  const PictureWarper warper(radiance, input.disparity);
  const int views = warped.u_count * warped.v_count;
  if (disparity != nullptr) disparity->resize(Index(views));
  model::ParallelFor(views, threads, [&](int view) {
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

Stencil StencilFromName(const std::string& name) {
  if (name == "warp") return Stencil::kWarp;
  if (name == "source") return Stencil::kSource;
  throw Error(fmt::format("stencil \"{}\" is unknown: it must be warp or source", name));
}

std::string StencilName(Stencil stencil) { return stencil == Stencil::kWarp ? "warp" : "source"; }

bool BlockOptions::IsValid(std::string* why) const {
  const auto fail = [why](std::string reason) {
    if (why != nullptr) *why = std::move(reason);
    return false;
  };
  if (gamma == 0) {
    return fail(
        "gamma is 0: then nothing but the ridge says how the rays of a scene point belong "
        "together, "
        "and the light field does not follow the scene's geometry; it must be > 0");
  }
  if (!(gamma > 0) || !std::isfinite(gamma)) {
    return fail(fmt::format("gamma is {}: it must be finite and > 0", gamma));
  }
  if (ridge && (!(*ridge >= 0) || !std::isfinite(*ridge))) {
    return fail(fmt::format("ridge is {}: it must be finite and >= 0", *ridge));
  }
  if (block_px && !(*block_px >= 1)) {
    return fail(fmt::format("block_px is {}: it must be >= 1", *block_px));
  }
  if (memory_limit_mib && !(*memory_limit_mib > 0)) {
    return fail(fmt::format("memory_limit_mib is {}: it must be > 0", *memory_limit_mib));
  }
  if (!(rcond_min >= 0) || !(rcond_min < 1)) {
    return fail(fmt::format("rcond_min is {}: it must be >= 0 and < 1", rcond_min));
  }
  if (!(tolerance > 0) || !(tolerance < 1)) {
    return fail(fmt::format("tolerance is {}: it must be > 0 and < 1", tolerance));
  }
  if (max_iterations < 1) {
    return fail(fmt::format("max_iterations is {}: it must be >= 1", max_iterations));
  }
  if (threads < 0) return fail(fmt::format("threads is {}: it must be >= 0", threads));
  return true;
}

}  // namespace thicklens::estimator
