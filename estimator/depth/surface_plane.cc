#include "estimator/depth/surface_plane.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace thicklens::estimator {
namespace {

constexpr std::size_t kMinSamples = 6;
constexpr double kMinSpreadPx = 0.3;  // standard deviation of the positions

double SquaredResiduals(const std::vector<SurfaceSample>& samples, const SurfacePlane& plane) {
  double sum = 0;
  for (const SurfaceSample& sample : samples) {
    const double residual = sample.disparity - plane.At(sample.x, sample.y);
    sum += residual * residual;
  }
  return sum;
}

}  // namespace

SurfacePlane FitSurfacePlane(const std::vector<SurfaceSample>& samples) {
  const auto count = static_cast<double>(samples.size());
  SurfacePlane plane;
  for (const SurfaceSample& sample : samples) {
    plane.middle_px += Eigen::Vector2d(sample.x, sample.y);
    plane.disparity += sample.disparity;
  }
  plane.middle_px /= count;
  plane.disparity /= count;
  const double least_squares = count * kMinSpreadPx * kMinSpreadPx;
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  Eigen::Vector2d products = Eigen::Vector2d::Zero();
  for (const SurfaceSample& sample : samples) {
    const Eigen::Vector2d from_middle = Eigen::Vector2d(sample.x, sample.y) - plane.middle_px;
    squares += from_middle * from_middle.transpose();
    products += from_middle * (sample.disparity - plane.disparity);
  }
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> principal;
  principal.computeDirect(squares);
  std::array<double, 2> along{0, 0};
  double unknowns = 1;
  for (int i = 0; i < 2 && samples.size() >= kMinSamples; ++i) {
    if (!(principal.eigenvalues()[i] > least_squares)) continue;
    along[static_cast<std::size_t>(i)] =
        principal.eigenvectors().col(i).dot(products) / principal.eigenvalues()[i];
    ++unknowns;
  }
  const auto set_slope = [&] {
    plane.slope = principal.eigenvectors() * Eigen::Vector2d(along[0], along[1]);
  };
  set_slope();
  const double unexplained = SquaredResiduals(samples, plane);
  const double variance = unexplained / std::max(1.0, count - unknowns);
  for (int i = 0; i < 2; ++i) {
    double& slope = along[static_cast<std::size_t>(i)];
    if (slope == 0) continue;
    const double explained = slope * slope * principal.eigenvalues()[i];
    slope *= std::max(0.0, 1 - variance / explained);
  }
  set_slope();
  plane.rms = std::sqrt(SquaredResiduals(samples, plane) / count);
  return plane;
}

}  // namespace thicklens::estimator
