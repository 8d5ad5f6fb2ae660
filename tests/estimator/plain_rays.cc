#include "tests/estimator/plain_rays.h"

#include <algorithm>
#include <cmath>

#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator::testing {

namespace {

// The pixels and weights that the sample i reads from a source.
Eigen::RowVectorXd Taps(const DisparityMap& map, int i, const kernels::OccludedSample& from) {
  const double tolerance = 0.3 / map.step.cwiseAbs().maxCoeff();
  const int pixels = map.width_px * map.height_px;
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(pixels);
  const double x =
      std::clamp<double>(i % map.width_px + double{from.source_x}, 0, map.width_px - 1);
  const double y =
      std::clamp<double>(i / map.width_px + double{from.source_y}, 0, map.height_px - 1);
  double closest = 1e300;
  int closest_pixel = 0;
  for (const int corner : {0, 1, map.width_px, map.width_px + 1}) {
    const int n = static_cast<int>(y) * map.width_px + static_cast<int>(x) + corner;
    if (n >= pixels) continue;
    const double hat = std::max(0.0, 1 - std::abs(x - n % map.width_px)) *
                       std::max(0.0, 1 - std::abs(y - n / map.width_px));
    if (!(hat > 0)) continue;
    const double apart =
        std::abs(double{map.disparity[static_cast<std::size_t>(n)]} - from.disparity);
    if (apart < closest) {
      closest = apart;
      closest_pixel = n;
    }
    if (apart <= tolerance) row(n) = hat;
  }
  const double sum = row.sum();
  if (sum > 0) return row / sum;
  row(closest_pixel) = 1;
  return row;
}

}  // namespace

Eigen::MatrixXd ViewMatrix(const DisparityMap& map, double a, double b) {
  const ViewDisparity view = RenderDisparity(map, a, b);
  const int pixels = map.width_px * map.height_px;
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(pixels, pixels);
  for (int i = 0; i < pixels; ++i) {
    const auto at = static_cast<std::size_t>(i);
    matrix.row(i) = Taps(map, i, {i, view.source_x[at], view.source_y[at], view.disparity[at]});
  }
  for (const kernels::BoundarySample& boundary : view.boundary) {
    matrix.row(boundary.index) *= 1 - double{boundary.share};
    matrix.row(boundary.index) +=
        double{boundary.share} * Taps(map, boundary.index, boundary.other);
  }
  return matrix;
}

Eigen::MatrixXd PhotographMatrix(const DisparityMap& map, const Eigen::ArrayXXd& weights) {
  const int pixels = map.width_px * map.height_px;
  Eigen::MatrixXd h = Eigen::MatrixXd::Zero(pixels, pixels * weights.size());
  for (Eigen::Index l = 0; l < weights.rows(); ++l) {
    for (Eigen::Index k = 0; k < weights.cols(); ++k) {
      const double a = static_cast<double>(k) - static_cast<double>(weights.cols() - 1) / 2;
      const double b = static_cast<double>(l) - static_cast<double>(weights.rows() - 1) / 2;
      h.middleCols((l * weights.cols() + k) * pixels, pixels) =
          weights(l, k) * ViewMatrix(map, a, b);
    }
  }
  return h;
}

}  // namespace thicklens::estimator::testing
