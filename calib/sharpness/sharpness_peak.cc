#include "calib/sharpness/sharpness_peak.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinFrames = 5;
constexpr double kTopFraction = 0.8;

}  // namespace

SharpnessPeak FitSharpnessPeak(std::vector<SharpnessSample> samples) {
  SharpnessPeak peak;
  samples.erase(std::remove_if(samples.begin(), samples.end(),
                               [](const SharpnessSample& s) { return !(s.index > 0); }),
                samples.end());
  if (samples.size() < kMinFrames) {
    peak.message = "fewer than five frames have edges";
    return peak;
  }
  std::sort(samples.begin(), samples.end(), [](const SharpnessSample& a, const SharpnessSample& b) {
    return a.depth_mm < b.depth_mm;
  });
  const auto top = std::max_element(samples.begin(), samples.end(),
                                    [](const auto& a, const auto& b) { return a.index < b.index; });
  const double reference_mm = top->depth_mm;
  const double floor_index = kTopFraction * top->index;
  auto first = top, last = top + 1;
  while (first != samples.begin() && (first - 1)->index >= floor_index) --first;
  while (last != samples.end() && last->index >= floor_index) ++last;
  // A coarse sweep has few frames that reach this: the nearest ones on both sides are taken.
  while (static_cast<std::size_t>(last - first) < kMinFrames) {
    if (first != samples.begin()) --first;
    if (last != samples.end() && static_cast<std::size_t>(last - first) < kMinFrames) ++last;
  }

  const auto n = static_cast<Eigen::Index>(last - first);
  Eigen::MatrixXd design(n, 3);
  Eigen::VectorXd logs(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const SharpnessSample& s = *(first + i);
    const double x = reference_mm / s.depth_mm - 1;
    design.row(i) << 1, x, x * x;
    logs[i] = std::log(s.index);
  }
  // The columns differ greatly in size, so they are scaled before the decomposition.
  const Eigen::Vector3d scale = design.colwise().norm().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = design * scale.cwiseInverse().asDiagonal();
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(scaled);
  peak.log_parabola = scale.cwiseInverse().asDiagonal() * qr.solve(logs);
  peak.reference_depth_mm = reference_mm;
  peak.from_depth_mm = first->depth_mm;
  peak.to_depth_mm = (last - 1)->depth_mm;
  peak.frames_used = static_cast<int>(n);
  const double curvature = peak.log_parabola[2];
  if (qr.rank() < 3 || !(curvature < 0)) {
    peak.message = "the top of the sharpness curve has no maximum";
    return peak;
  }
  const double x_peak = -peak.log_parabola[1] / (2 * curvature);
  if (!(x_peak > -1)) {
    peak.message = "the top of the sharpness curve has its maximum beyond infinity";
    return peak;
  }
  peak.focus_depth_mm = reference_mm / (1 + x_peak);

  const double rest = (design * peak.log_parabola - logs).squaredNorm() /
                      static_cast<double>(std::max<Eigen::Index>(1, n - 3));
  const Eigen::Matrix3d covariance = scale.cwiseInverse().asDiagonal() *
                                     (scaled.transpose() * scaled).inverse() *
                                     scale.cwiseInverse().asDiagonal() * rest;
  const Eigen::Vector3d dx(0, -1 / (2 * curvature),
                           peak.log_parabola[1] / (2 * curvature * curvature));
  const double x_sigma = std::sqrt(std::max(0.0, dx.dot(covariance * dx)));
  peak.sigma_mm = x_sigma * peak.focus_depth_mm * peak.focus_depth_mm / reference_mm;
  peak.done = true;
  peak.message = "fitted";
  return peak;
}

}  // namespace thicklens::calib
