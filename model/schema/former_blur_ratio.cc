#include "model/schema/former_blur_ratio.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace thicklens::model {
namespace {

constexpr int kNodes = 12;

// Nodes, A^2/sigma^2, and weights of a mean over an aperture of sigma 1.
struct Rule {
  Eigen::ArrayXd at, weight;
};

// Gauss rule after Golub and Welsch (1969), from the recurrence of the orthogonal polynomials.
Rule GaussRule(const Eigen::VectorXd& diagonal, const Eigen::VectorXd& beside) {
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver;
  solver.computeFromTridiagonal(diagonal, beside);
  return {solver.eigenvalues().array(), solver.eigenvectors().row(0).transpose().array().square()};
}

// A^2/2 of a Gaussian has the density exp(-x): the Laguerre polynomials.
Rule GaussianRule() {
  Eigen::VectorXd diagonal(kNodes), beside(kNodes - 1);
  for (int k = 0; k < kNodes; ++k) diagonal[k] = 2 * k + 1;
  for (int k = 1; k < kNodes; ++k) beside[k - 1] = k;
  Rule rule = GaussRule(diagonal, beside);
  rule.at *= 2;
  return rule;
}

// A^2 of a disc of radius 2 is uniform from 0 to 4: the Legendre polynomials.
Rule DiscRule() {
  Eigen::VectorXd beside(kNodes - 1);
  for (int k = 1; k < kNodes; ++k) beside[k - 1] = k / std::sqrt(4.0 * k * k - 1);
  Rule rule = GaussRule(Eigen::VectorXd::Zero(kNodes), beside);
  rule.at = 2 * (1 + rule.at);
  return rule;
}

}  // namespace

BlurRatioOfBlur BlurRatioWithFalloff(const ThickLens& lens, Psf psf, double blur_ratio,
                                     double focus_depth_mm) {
  static const Rule gaussian = GaussianRule(), disc = DiscRule();
  const Rule& rule = psf == Psf::kDisc ? disc : gaussian;
  const double sigma_mm = blur_ratio * lens.aperture_radius_mm;
  const double d1_mm = ImageDistanceMm(lens, focus_depth_mm);
  const Eigen::ArrayXd square = sigma_mm * sigma_mm * rule.at;  // A^2, mm^2
  // tan^2(alpha), tan^2(beta), and the derivatives of ln w by the logarithms of zf and d1.
  const Eigen::ArrayXd front = square / (focus_depth_mm * focus_depth_mm);
  const Eigen::ArrayXd behind = square / (d1_mm * d1_mm);
  const Eigen::ArrayXd by_focus = front / (1 + front);
  const Eigen::ArrayXd by_distance = 3 * behind / (1 + behind);
  const Eigen::ArrayXd weight =
      rule.weight / ((1 + front).sqrt() * (1 + behind) * (1 + behind).sqrt());
  const double sum = weight.sum();
  const auto mean = [&](const Eigen::ArrayXd& of) { return (weight * of).sum() / sum; };
  const Eigen::ArrayXd half = 0.5 * rule.at;  // A_x^2/sigma^2, averaged over a circle
  const double variance_ratio = mean(half);
  // Derivative of the ratio of two means whose weights change by the factor exp(d ln w).
  const auto slope = [&](const Eigen::ArrayXd& by) {
    return mean(half * by) - variance_ratio * mean(by);
  };
  const double by_log_focus = slope(by_focus), by_log_distance = slope(by_distance);
  const double log_distance_slope = ImageDistanceSlope(lens, focus_depth_mm) / d1_mm;
  BlurRatioOfBlur ratio;
  ratio.squared = blur_ratio * blur_ratio * variance_ratio;
  ratio.by_blur_ratio = blur_ratio * (2 * variance_ratio - by_log_focus - by_log_distance);
  ratio.by_focus_depth = blur_ratio * blur_ratio *
                         (by_log_focus / focus_depth_mm + by_log_distance * log_distance_slope);
  return ratio;
}

void ConvertFormerBlurRatio(Camera* camera) {
  if (!camera->calibration || !camera->calibration->blur_ratio) return;
  CameraCalibration& calibration = *camera->calibration;
  const std::string& method = calibration.evidence.method;
  if (method != "joint-blur-fit" || !calibration.image_distance_mm) return;
  const double zf_mm = camera->focus_depth_mm();
  Estimate& kappa = *calibration.blur_ratio;
  if (!(kappa.value > 0)) return;
  if (!std::isfinite(zf_mm)) {
    camera->notices.push_back(fmt::format(
        "camera '{}': its file has an earlier schema, in which blur_ratio {:.5g} described the "
        "aperture before fall-off; it cannot be converted for a camera focused at infinity and is "
        "used as the ratio of the blur itself. Calibrate again",
        camera->name, kappa.value));
    return;
  }
  const BlurRatioOfBlur of_blur =
      BlurRatioWithFalloff(camera->lens, camera->psf, kappa.value, zf_mm);
  const double converted = std::sqrt(of_blur.squared);
  const double by_former = of_blur.by_blur_ratio / (2 * converted);
  // Derivative by d1, through zf, which follows from d1.
  const double by_distance =
      of_blur.by_focus_depth / ImageDistanceSlope(camera->lens, zf_mm) / (2 * converted);
  const auto& order = calibration.covariance_order;
  const auto at = [&order](const char* name) {
    return std::find(order.begin(), order.end(), name) - order.begin();
  };
  const auto count = static_cast<Eigen::Index>(order.size());
  const Eigen::Index ratio = at("blur_ratio"), distance = at("image_distance_mm");
  double distance_sigma_mm = calibration.image_distance_mm->sigma;
  kappa.sigma = std::hypot(by_former * kappa.sigma, by_distance * distance_sigma_mm);
  if (ratio < count) {
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Identity(count, count);
    jacobian(ratio, ratio) = by_former;
    if (distance < count) jacobian(ratio, distance) = by_distance;
    calibration.covariance = jacobian * calibration.covariance * jacobian.transpose();
    // Rounding must not destroy the symmetry.
    calibration.covariance =
        Eigen::MatrixXd(0.5 * (calibration.covariance + calibration.covariance.transpose()));
    if (distance < count) kappa.sigma = std::sqrt(calibration.covariance(ratio, ratio));
  }
  camera->notices.push_back(fmt::format(
      "camera '{}': its file has an earlier schema, in which blur_ratio {:.5g} described the "
      "aperture before fall-off; it was converted to {:.5g}, the ratio of the blur itself. "
      "Calibrate again, or write the camera file again, to store the converted ratio",
      camera->name, kappa.value, converted));
  kappa.value = converted;
}

}  // namespace thicklens::model
