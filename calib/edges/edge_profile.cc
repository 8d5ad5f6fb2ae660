#include "calib/edges/edge_profile.h"

#include <math.h>  // ::j1, ::jn are POSIX; std::cyl_bessel_j is missing from some standard libraries

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>

#include "thicklens/base/pi.h"
#include "thicklens/model/blur_transfer.h"

namespace thicklens::calib {
namespace {

// Minimum width of the pixel's box. Dividing the second difference by a narrower box would lose the
// digits; this width blurs by less than 1e-9 px^2.
constexpr double kNarrowestBoxPx = 1e-4;
// Phi(-6) = 1e-9.
constexpr double kGaussianReach = 6;
constexpr double kMinVariancePx2 = 0.02;
// Minimum width of the Gaussian behind a disc. A narrower one would only lengthen the series: the
// pixel's box is ten times as wide.
constexpr double kMinFloorPx = 0.1;

// The normal distribution Phi(x/sigma), its first antiderivative x Phi + sigma phi, px, and its
// second one [(x^2 + sigma^2) Phi + x sigma phi]/2, px^2, all 0 at -infinity. The formulas are
// derived by integration by parts [D33].
struct Antiderivatives {
  double none = 0, first = 0, second = 0;
};
Antiderivatives Gaussian(double x, double sigma) {
  const double t = x / sigma;
  const double cumulative = std::erfc(-t / std::sqrt(2.0)) / 2;
  const double density = sigma * std::exp(-t * t / 2) / std::sqrt(2 * kPi);
  return {cumulative, x * cumulative + density,
          ((x * x + sigma * sigma) * cumulative + x * density) / 2};
}

}  // namespace

EdgeProfile::EdgeProfile(model::Psf psf, double variance_px2, double floor_px, double normal_rad) {
  // A fit may try any value; NaN is treated as the minimum.
  const double shown_px2 = variance_px2 > kMinVariancePx2 ? variance_px2 : kMinVariancePx2;
  const double gaussian_px2 = std::pow(std::max(floor_px, kMinFloorPx), 2);
  if (psf == model::Psf::kDisc && shown_px2 > gaussian_px2) {
    TabulateDisc(gaussian_px2, shown_px2, normal_rad);
  } else {
    TabulateGaussian(shown_px2, normal_rad);
  }
  if (variance_px2 < shown_px2) {
    for (Value& node : nodes_) node.level += (variance_px2 - shown_px2) * node.per_variance;
  }
}

void EdgeProfile::Allocate(double reach_px, double gaussian_px2) {
  // The step is a sixth of the narrowest detail. The cubic between two nodes is then good to 1e-5.
  step_px_ = std::sqrt(gaussian_px2 + 0.02) / 6;
  half_ = static_cast<std::size_t>(std::ceil(reach_px / step_px_));
  reach_px_ = static_cast<double>(half_) * step_px_;
  nodes_.resize(2 * half_ + 1);
}

void EdgeProfile::Set(std::size_t node, const Value& value) {
  nodes_[half_ - node] = {1 - value.level, value.slope, -value.per_variance};
  nodes_[half_ + node] = value;
}

// The pixel's box projected on the normal is the convolution of two boxes whose widths are a =
// |cos| and b = |sin| of its angle. With F the second antiderivative of Phi(d/sigma) (derived here,
// [D32]),
//   E(d) = [F(d + (a+b)/2) - F(d + (a-b)/2) - F(d - (a-b)/2) + F(d - (a+b)/2)]/(a b).
// The slope has the same form with F' instead of F. dE/d(sigma^2) = E''/2 (the heat equation) is
// half of the same form with F''. The limit for b = 0 is E = [F'(d + 1/2) - F'(d - 1/2)].
void EdgeProfile::TabulateGaussian(double variance_px2, double normal_rad) {
  const double sigma = std::sqrt(variance_px2);
  const double a = std::max(std::abs(std::cos(normal_rad)), kNarrowestBoxPx);
  const double b = std::max(std::abs(std::sin(normal_rad)), kNarrowestBoxPx);
  Allocate(kGaussianReach * sigma + (a + b) / 2, variance_px2);
  const std::array<double, 4> shift = {(a + b) / 2, (a - b) / 2, -(a - b) / 2, -(a + b) / 2};
  const std::array<double, 4> sign = {1, -1, -1, 1};
  for (std::size_t node = 0; node <= half_; ++node) {
    // On the dark side F is small and keeps its digits.
    const double d = -Distance(node);
    Value sum;
    for (std::size_t i = 0; i < shift.size(); ++i) {
      const Antiderivatives f = Gaussian(d + shift[i], sigma);
      sum.level += sign[i] * f.second / (a * b);
      sum.slope += sign[i] * f.first / (a * b);
      sum.per_variance += sign[i] * f.none / (2 * a * b);
    }
    Set(node, {1 - sum.level, sum.slope, -sum.per_variance});
  }
}

// A disc and a Gaussian together have no closed form. The series describes a step up at 0, a step
// down at L/2, and so on with the period L, blurred with the transfer function T (derived here,
// [D34]):
//   E(d) = 1/2 + sum over odd k of 2/(pi k) T(k/L) sin(2 pi k d/L).
// The two edges do not overlap for L > 4 reach. The disc's transfer function D = 2 J1(x)/x, x = 2
// pi f R, with R^2 = 4 (sigma^2 - floor^2), has dD/d(sigma^2) = -4 (2 pi f)^2 J2(x)/x^2.
void EdgeProfile::TabulateDisc(double gaussian_px2, double variance_px2, double normal_rad) {
  const double gaussian_sigma_px = std::sqrt(gaussian_px2);
  const double radius_px = 2 * std::sqrt(variance_px2 - gaussian_px2);
  const double cosine = std::cos(normal_rad), sine = std::sin(normal_rad);
  Allocate(radius_px + kGaussianReach * gaussian_sigma_px + (std::abs(cosine) + std::abs(sine)) / 2,
           gaussian_px2);
  const double period_px = 4.1 * reach_px_;

  std::vector<Value> terms;
  for (int k = 1;; k += 2) {
    const double f = k / period_px;
    const double gaussian = model::GaussianTransfer(gaussian_sigma_px, f, 0);
    if (gaussian < 1e-8) break;
    const double rest = gaussian * model::PixelBoxTransfer(f * cosine, f * sine) * 2 / (kPi * k);
    const double omega = 2 * kPi * f;
    const double x = omega * radius_px;
    // J2(x)/x^2 = 1/8 - x^2/96 + ...
    const double second = x < 1e-2 ? 0.125 - x * x / 96 : ::jn(2, x) / (x * x);
    const double level = rest * model::DiscTransfer(radius_px, f, 0);
    terms.push_back({level, level * omega, -4 * omega * omega * second * rest});
  }
  for (std::size_t node = 0; node <= half_; ++node) {
    std::complex<double> wave = std::polar(1.0, 2 * kPi * Distance(node) / period_px);
    const std::complex<double> turn = wave * wave;
    Value sum{0.5, 0, 0};
    for (const Value& term : terms) {
      sum.level += term.level * wave.imag();
      sum.slope += term.slope * wave.real();
      sum.per_variance += term.per_variance * wave.imag();
      wave = {wave.real() * turn.real() - wave.imag() * turn.imag(),
              wave.real() * turn.imag() + wave.imag() * turn.real()};
    }
    Set(node, sum);
  }
}

EdgeProfile::Value EdgeProfile::At(double distance_px) const {
  if (!(distance_px > -reach_px_)) return {0, 0, 0};
  if (!(distance_px < reach_px_)) return {1, 0, 0};
  const double position = distance_px / step_px_ + static_cast<double>(half_);
  const std::size_t node = std::min(static_cast<std::size_t>(position), nodes_.size() - 2);
  const double t = position - static_cast<double>(node);
  const Value& left = nodes_[node];
  const Value& right = nodes_[node + 1];
  // The levels use the cubic through both levels with both slopes; linear interpolation suffices
  // for the derivatives.
  const double rise = right.level - left.level;
  const double bend_left = left.slope * step_px_ - rise;
  const double bend_right = rise - right.slope * step_px_;
  return {left.level + t * rise + t * (1 - t) * ((1 - t) * bend_left + t * bend_right),
          left.slope + t * (right.slope - left.slope),
          left.per_variance + t * (right.per_variance - left.per_variance)};
}

}  // namespace thicklens::calib
