#include "calib/registration/blur_slope.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinSamples = 5;
// The error of an added variance: a relative part and px^2.
constexpr double kRelativeError = 0.2, kMinErrorPx2 = 0.2;
constexpr double kSignificant = 4;
constexpr int kRounds = 8;
constexpr double kCauchyWidth = 3;
// Standard deviations of the logarithm of the ratio. The light of a whole aperture gives 0.5, and
// no lens gives more than 0.7.
constexpr double kDeviationBelow = 0.3, kDeviationAbove = 0.25;
constexpr double kImpossible = 1e3;

}  // namespace

double BlurSlope::RatioOfMovingTarget(const model::Camera& camera, double focus_depth_mm) const {
  const double f1_mm = camera.lens.front_focal_length_mm;
  return px * camera.sensor.pixel_pitch_mm / camera.lens.aperture_radius_mm *
         (focus_depth_mm - f1_mm) / f1_mm;
}

double BlurSlope::RatioOfMovingLens(const model::Camera& camera) const {
  return px * camera.sensor.pixel_pitch_mm / camera.lens.aperture_radius_mm;
}

double ChiSquareOfRatio(double blur_ratio) {
  if (!(blur_ratio > 0)) return kImpossible;
  const double log_ratio = std::log(blur_ratio / kUsualBlurRatio);
  const double off = log_ratio / (log_ratio > 0 ? kDeviationAbove : kDeviationBelow);
  return std::min(off * off, kImpossible);
}

// The difference sigma_i^2 - s_i^2 sigma_ref^2 with sigma^2 = S0 + A (s - s0)^2 is 0 at s = 1. It
// is b (s - 1) + q (s - 1)^2 with q = A (1 - (1 - s0)^2) - S0, which is A where the reference is
// sharp.
std::optional<BlurSlope> FindBlurSlope(const std::vector<ScaleSample>& samples) {
  std::vector<Eigen::Vector3d> rows;  // s - 1, (s - 1)^2, added variance
  for (const ScaleSample& sample : samples) {
    const std::optional<double>& added_px2 = sample.registration.added_variance_px2;
    if (!added_px2 || sample.scale_is_from_reading) continue;
    const double change = sample.scale - 1;
    rows.emplace_back(change, change * change, *added_px2);
  }
  if (rows.size() < kMinSamples) return std::nullopt;
  std::vector<double> weights(rows.size(), 1);
  Eigen::Vector2d terms(0, 0);
  double variance = 0;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const double sigma = kRelativeError * std::abs(rows[i].z()) + kMinErrorPx2;
      const double weight = weights[i] / (sigma * sigma);
      normal += weight * rows[i].head<2>() * rows[i].head<2>().transpose();
      right += weight * rows[i].head<2>() * rows[i].z();
    }
    // The matrix is scaled, because its columns differ by the size of s - 1.
    const Eigen::Vector2d unit = normal.diagonal().cwiseSqrt().cwiseMax(1e-300).cwiseInverse();
    const Eigen::Matrix2d scaled = unit.asDiagonal() * normal * unit.asDiagonal();
    if (!(scaled.determinant() > 1e-9)) return std::nullopt;
    const Eigen::Matrix2d inverse = unit.asDiagonal() * scaled.inverse() * unit.asDiagonal();
    terms = inverse * right;
    double sum = 0;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const double sigma = kRelativeError * std::abs(rows[i].z()) + kMinErrorPx2;
      const double off = (rows[i].z() - rows[i].head<2>().dot(terms)) / sigma;
      sum += weights[i] * off * off;
      weights[i] = 1 / (1 + off * off / (kCauchyWidth * kCauchyWidth));
    }
    const double spread = std::max(1.0, sum / static_cast<double>(rows.size() - 2));
    variance = spread * inverse(1, 1);
  }
  if (!(terms.y() > kSignificant * std::sqrt(variance))) return std::nullopt;
  return BlurSlope{std::sqrt(terms.y())};
}

}  // namespace thicklens::calib
