#include "picture_load.h"

#include <cmath>

namespace thicklens::tools {
namespace {

// Of the views' places along one axis, in view steps squared.
double VarianceOf(const Eigen::ArrayXd& weights) {
  const Eigen::ArrayXd places =
      Eigen::ArrayXd::LinSpaced(weights.size(), 0, static_cast<double>(weights.size() - 1));
  const double mean = (weights * places).sum();
  return (weights * (places - mean).square()).sum();
}

}  // namespace

PictureLoad PictureLoadOf(const estimator::EstimateInput& input) {
  const estimator::DisparityMap& map = input.disparity;
  double square_sum = 0;
  for (const float disparity : map.disparity) {
    square_sum += static_cast<double>(disparity) * static_cast<double>(disparity);
  }
  const auto pixels = static_cast<double>(map.disparity.size());
  // A point lands in the view (a, b) at its disparity times the view's place; the views' weights
  // spread it in x and in y.
  const double spread_x = VarianceOf(input.weights.colwise().sum().transpose());
  const double spread_y = VarianceOf(input.weights.rowwise().sum());
  const double per_disparity =
      (map.step.x() * map.step.x() * spread_x + map.step.y() * map.step.y() * spread_y) / 2;
  PictureLoad load;
  load.megapixels = 1e-6 * pixels;
  load.channels = input.picture.channels;
  load.views = static_cast<int>(input.weights.size());
  load.blur_sigma_px = std::sqrt(square_sum / pixels * per_disparity);
  return load;
}

}  // namespace thicklens::tools
