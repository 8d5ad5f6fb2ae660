#include "thicklens/model/weighed_aperture.h"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace thicklens::model {
namespace {

constexpr int kNodes = 12;

// Nodes and weights of a mean of A^2/sigma^2 over an aperture of sigma 1.
struct Rule {
  Eigen::ArrayXd at, weight;
};

// After Golub and Welsch (1969), from the recurrence of the orthogonal polynomials.
Rule GaussRule(const Eigen::VectorXd& diagonal, const Eigen::VectorXd& beside) {
  Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver;
  solver.computeFromTridiagonal(diagonal, beside);
  return {solver.eigenvalues().array(), solver.eigenvectors().row(0).transpose().array().square()};
}

// A^2/2 of a Gaussian has the density exp(-x): Laguerre's polynomials.
Rule OfGaussian() {
  Eigen::VectorXd diagonal(kNodes), beside(kNodes - 1);
  for (int k = 0; k < kNodes; ++k) diagonal[k] = 2 * k + 1;
  for (int k = 1; k < kNodes; ++k) beside[k - 1] = k;
  Rule rule = GaussRule(diagonal, beside);
  rule.at *= 2;
  return rule;
}

// A^2 of a disc of radius 2 is uniform from 0 to 4: Legendre's.
Rule OfDisc() {
  Eigen::VectorXd beside(kNodes - 1);
  for (int k = 1; k < kNodes; ++k) beside[k - 1] = k / std::sqrt(4.0 * k * k - 1);
  Rule rule = GaussRule(Eigen::VectorXd::Zero(kNodes), beside);
  rule.at = 2 * (1 + rule.at);
  return rule;
}

double ScaleMm(const ThickLens& lens, double focus_depth_mm) {
  return lens.front_focal_length_mm / (1 - lens.front_focal_length_mm / focus_depth_mm);
}

ApertureOptics OpticsOf(const ThickLens& lens, Psf psf, double blur_ratio, double focus_depth_mm) {
  return {psf, blur_ratio * lens.aperture_radius_mm, focus_depth_mm,
          ImageDistanceMm(lens, focus_depth_mm)};
}

}  // namespace

WeighedAperture WeighAperture(const ApertureOptics& optics, double scale_mm) {
  static const Rule gaussian = OfGaussian(), disc = OfDisc();
  const Rule& rule = optics.psf == Psf::kDisc ? disc : gaussian;
  const double d1_squared = optics.image_distance_mm * optics.image_distance_mm;
  const Eigen::ArrayXd square = optics.sigma_mm * optics.sigma_mm * rule.at;  // A^2, mm^2
  // tan^2 of alpha and of beta, and what d ln w by the logarithms of zf and d1 is.
  const Eigen::ArrayXd front = square / (optics.focus_depth_mm * optics.focus_depth_mm);
  const Eigen::ArrayXd behind = square / d1_squared;
  const Eigen::ArrayXd by_focus = front / (1 + front);
  const Eigen::ArrayXd by_distance = 3 * behind / (1 + behind);
  const Eigen::ArrayXd weight =
      rule.weight / ((1 + front).sqrt() * (1 + behind) * (1 + behind).sqrt());
  const double sum = weight.sum();
  const auto mean = [&](const Eigen::ArrayXd& of) { return (weight * of).sum() / sum; };

  WeighedAperture weighed;
  const Eigen::ArrayXd half = 0.5 * rule.at;  // A_x^2/sigma^2, averaged over a circle
  weighed.variance_ratio = mean(half);
  // Of the ratio of two means whose weights change by the factor exp(d ln w).
  const auto slope = [&](const Eigen::ArrayXd& by) {
    return mean(half * by) - weighed.variance_ratio * mean(by);
  };
  weighed.by_log_focus_depth = slope(by_focus);
  weighed.by_log_image_distance = slope(by_distance);
  weighed.by_log_sigma = -weighed.by_log_focus_depth - weighed.by_log_image_distance;
  weighed.mean_per_landing = optics.sigma_mm * optics.sigma_mm *
                             mean(half * (1 / (scale_mm * optics.focus_depth_mm * (1 + front)) -
                                          3 / (d1_squared * (1 + behind))));
  return weighed;
}

SeenBlurRatio SeeBlurRatio(const ThickLens& lens, Psf psf, double blur_ratio,
                           double focus_depth_mm) {
  const WeighedAperture weighed =
      WeighAperture(OpticsOf(lens, psf, blur_ratio, focus_depth_mm), ScaleMm(lens, focus_depth_mm));
  const double log_distance_slope =
      ImageDistanceSlope(lens, focus_depth_mm) / ImageDistanceMm(lens, focus_depth_mm);
  SeenBlurRatio seen;
  seen.squared = blur_ratio * blur_ratio * weighed.variance_ratio;
  seen.by_blur_ratio = blur_ratio * (2 * weighed.variance_ratio + weighed.by_log_sigma);
  seen.by_focus_depth = blur_ratio * blur_ratio *
                        (weighed.by_log_focus_depth / focus_depth_mm +
                         weighed.by_log_image_distance * log_distance_slope);
  return seen;
}

double CentreOfPerspectiveMm(const ThickLens& lens, Psf psf, double blur_ratio,
                             double focus_depth_mm) {
  const double scale_mm = ScaleMm(lens, focus_depth_mm);
  const WeighedAperture weighed =
      WeighAperture(OpticsOf(lens, psf, blur_ratio, focus_depth_mm), scale_mm);
  const double shift_mm = weighed.mean_per_landing * scale_mm;
  return -shift_mm / (1 - shift_mm / focus_depth_mm);
}

}  // namespace thicklens::model
