#include "estimator/views/input_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "estimator/views/ray_landing.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"

namespace thicklens::estimator {
namespace {

[[noreturn]] void Fail(const std::string& what) { throw Error("estimate: " + what); }

double LargestDisparityPx(const DisparityMap& map) {
  double largest = 0;
  for (const float value : map.disparity) {
    largest = std::max(largest, static_cast<double>(std::abs(value)));
  }
  return largest * map.step.cwiseAbs().maxCoeff();
}

void CheckImage(const model::LinearImage& image) {
  if (image.channels < 1) {
    Fail(fmt::format("the image has {} channels: it must have at least 1", image.channels));
  }
  if (image.width_px < 1 || image.height_px < 1 ||
      image.values.size() !=
          Index(image.width_px) * Index(image.height_px) * Index(image.channels)) {
    Fail(
        fmt::format("the image has {}x{} px and {} values: the count of values must be the "
                    "product of its size and its channels, and not 0",
                    image.width_px, image.height_px, image.values.size()));
  }
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    if (std::isfinite(image.values[i])) continue;
    const std::size_t pixel = i / Index(image.channels);
    Fail(fmt::format("the image has the value {} at ({}, {}): every value must be finite",
                     image.values[i], pixel % Index(image.width_px),
                     pixel / Index(image.width_px)));
  }
}

void CheckDisparity(const DisparityMap& map, const model::LinearImage& image) {
  if (map.width_px != image.width_px || map.height_px != image.height_px) {
    Fail(fmt::format("the depth has {}x{} px, but the image has {}x{} px: the sizes must be equal",
                     map.width_px, map.height_px, image.width_px, image.height_px));
  }
  if (!std::all_of(map.disparity.begin(), map.disparity.end(),
                   [](float value) { return std::isfinite(value); })) {
    Fail("the disparity has holes: they must be filled");
  }
  const double widest_px = LargestDisparityPx(map);
  const int size_px = std::max(image.width_px, image.height_px);
  if (!(widest_px <= size_px)) {
    Fail(
        fmt::format("the largest disparity is {:.4g} px per view step: it must be at most the "
                    "image's size, {} px; check its scale",
                    widest_px, size_px));
  }
}

void CheckWeights(const Eigen::ArrayXXd& weights) {
  if (weights.size() < 2) {
    Fail(fmt::format("views are {}x{}: a light field needs at least two", weights.cols(),
                     weights.rows()));
  }
  for (Eigen::Index l = 0; l < weights.rows(); ++l) {
    for (Eigen::Index k = 0; k < weights.cols(); ++k) {
      if (weights(l, k) >= 0 && std::isfinite(weights(l, k))) continue;
      Fail(fmt::format("the weight of the view ({}, {}) is {}: it must be finite and >= 0", k, l,
                       weights(l, k)));
    }
  }
  if (!(std::abs(weights.sum() - 1) < 1e-6)) {
    Fail(fmt::format("the weights of the views have the sum {}: it must be 1", weights.sum()));
  }
}

}  // namespace

void CheckInput(const EstimateInput& input) {
  const model::LinearImage& image = input.image;
  CheckImage(image);
  if (!input.clipped.empty() && input.clipped.size() != image.values.size()) {
    Fail(fmt::format(
        "the marks of clipped values are {}, but the image has {} values: the counts must be equal",
        input.clipped.size(), image.values.size()));
  }
  CheckDisparity(input.disparity, image);
  CheckWeights(input.weights);
  if (input.grid.has_value() != input.camera.has_value()) {
    Fail("either the camera or the grid is missing: both or neither must be given");
  }
  if (input.grid && input.grid->planes.uv_depth_mm != 0) {
    Fail(
        fmt::format("the UV plane lies at the depth {} mm: it must be 0, the aperture, where a "
                    "view has one transmission for all its rays",
                    input.grid->planes.uv_depth_mm));
  }
  if (input.grid &&
      (input.grid->s_count != image.width_px || input.grid->t_count != image.height_px ||
       input.grid->u_count != input.weights.cols() ||
       input.grid->v_count != input.weights.rows())) {
    Fail(fmt::format(
        "the grid has {}x{} samples and {}x{} views, but the image has {}x{} px and there are "
        "{}x{} weights: the counts must be equal",
        input.grid->s_count, input.grid->t_count, input.grid->u_count, input.grid->v_count,
        image.width_px, image.height_px, input.weights.cols(), input.weights.rows()));
  }
}

model::LightField DescriptionOf(const EstimateInput& input) {
  model::LightField description;
  description.s_count = input.image.width_px;
  description.t_count = input.image.height_px;
  description.u_count = static_cast<int>(input.weights.cols());
  description.v_count = static_cast<int>(input.weights.rows());
  description.channels = input.image.channels;
  description.weights = input.weights;
  description.transfer = input.transfer;
  description.grid = input.grid;
  description.camera = input.camera;
  if (input.grid) description.landing_step_px = LandingStepPx(*input.camera, *input.grid);
  return description;
}

model::LightField FrameOf(const EstimateInput& input) {
  model::LightField frame = DescriptionOf(input);
  frame.values.assign(frame.ViewStart(frame.channels, 0, 0), 0.0F);
  return frame;
}

}  // namespace thicklens::estimator
