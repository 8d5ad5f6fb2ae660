#include "benchmarks/accuracy/fisher_bound.h"

#include <Eigen/Dense>
#include <cmath>

namespace thicklens::accuracy {
namespace {

// Central differences use a relative step. The second number is the smallest standard deviation of
// a variance, px^2, for frames in which the readings have no effect on the variance.
constexpr double kRelativeStep = 1e-5;
constexpr double kMinErrorPx2 = 1e-6;

// Blur variance that a texture of unknown sharpness shows in a frame at depth z: the variance on
// the target in px^2 of the plane of reference, plus a constant c of the texture, V = S z^2/zref^2
// + c, S = S0 + (kappa r K/p)^2 (1/z - 1/zf)^2, K = f1 zf/(zf - f1). Derived here: 1 px at depth z
// covers p z/(K zref) times as much as at zref.
struct Law {
  model::ThickLens lens;
  double pixel_pitch_mm = 0;
  double reference_depth_mm = 0;

  // `parameters`: zf in mm, ln kappa, c in px^2.
  double At(double depth_mm, const Eigen::Vector3d& parameters, double floor_px2) const {
    const double f1 = lens.front_focal_length_mm, zf = parameters(0);
    const double sigma_px = std::exp(parameters(1)) * lens.aperture_radius_mm * f1 * zf /
                            (zf - f1) / pixel_pitch_mm * (1 / depth_mm - 1 / zf);
    const double scale = depth_mm / reference_depth_mm;
    return (floor_px2 + sigma_px * sigma_px) * scale * scale + parameters(2);
  }
};

double SlopeMm(const model::ThickLens& lens, double zf) {
  const double f1 = lens.front_focal_length_mm;
  return -lens.rear_focal_length_mm * f1 / ((zf - f1) * (zf - f1));
}

Bound MakeBound(const model::ThickLens& lens, double zf, double zf_sigma, double kappa_sigma) {
  return {zf_sigma, std::abs(SlopeMm(lens, zf)) * zf_sigma, kappa_sigma};
}

Bound Sum(const Bound& a, const Bound& b) {
  return {std::hypot(a.focus_depth_mm, b.focus_depth_mm),
          std::hypot(a.image_distance_mm, b.image_distance_mm),
          std::hypot(a.relative_blur_ratio, b.relative_blur_ratio)};
}

}  // namespace

FisherBounds BoundsOf(const model::SweepSimulationOptions& options, double floor_sigma_px2) {
  const model::Camera& camera = options.camera;
  const double zf = camera.focus_depth_mm();
  const double floor_px2 = std::pow(camera.calibration->blur_floor_px->value, 2);
  const Law law{camera.lens, camera.sensor.pixel_pitch_mm, zf};
  const Eigen::Vector3d truth(zf, std::log(camera.blur_ratio()), 0);
  const Eigen::Vector3d steps(kRelativeStep * zf, kRelativeStep, kRelativeStep);

  const int n = options.frame_count;
  Eigen::MatrixXd jacobian(n, 3);
  Eigen::VectorXd by_floor(n), error_px2(n);
  double sum_depths2 = 0;
  for (int i = 0; i < n; ++i) {
    const double z = options.first_depth_mm + i * options.step_mm;
    sum_depths2 += z * z;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d step = steps(k) * Eigen::Vector3d::Unit(k);
      jacobian(i, k) = (law.At(z, truth + step, floor_px2) - law.At(z, truth - step, floor_px2)) /
                       (2 * steps(k));
    }
    by_floor(i) =
        (law.At(z, truth, floor_px2 + kRelativeStep) - law.At(z, truth, floor_px2)) / kRelativeStep;
    const double dz = kRelativeStep * z;
    const double slope =
        (law.At(z + dz, truth, floor_px2) - law.At(z - dz, truth, floor_px2)) / (2 * dz);
    error_px2(i) = std::hypot(slope * options.reading_sigma_mm, kMinErrorPx2);
  }

  FisherBounds bounds;
  // An error of the floor moves the other parameters to where the law is the same.
  const Eigen::Vector3d moved = jacobian.colPivHouseholderQr().solve(by_floor) * floor_sigma_px2;
  bounds.floor = MakeBound(camera.lens, zf, std::abs(moved(0)), std::abs(moved(1)));

  // The matrix is (J^T Q^-1 J)^-1, where Q is the variance of V that results from the errors of the
  // readings.
  const Eigen::MatrixXd weighted = error_px2.cwiseInverse().asDiagonal() * jacobian;
  const Eigen::Matrix3d covariance = (weighted.transpose() * weighted).inverse();
  bounds.readings =
      MakeBound(camera.lens, zf, std::sqrt(covariance(0, 0)), std::sqrt(covariance(1, 1)));

  // If the scales are known, all depths are known up to one factor 1 + e, and the readings measure
  // z_i (1 + e) with their errors: var e = s^2/sum z_i^2. zf is proportional to 1 + e. V stays the
  // same if kappa K does, so kappa is proportional to 1 + e zf/(zf - f1).
  const double factor_sigma = options.reading_sigma_mm / std::sqrt(sum_depths2);
  bounds.scaled = MakeBound(camera.lens, zf, zf * factor_sigma,
                            factor_sigma * zf / (zf - camera.lens.front_focal_length_mm));
  bounds.together = Sum(bounds.floor, bounds.scaled);
  return bounds;
}

}  // namespace thicklens::accuracy
