#ifndef THICKLENS_TESTS_SUPPORT_BLUR_ORACLES_H_
#define THICKLENS_TESTS_SUPPORT_BLUR_ORACLES_H_

#include <algorithm>
#include <cmath>

#include "thicklens/model/camera.h"

namespace thicklens::testing {

// The share of a blur on one side of a straight line, and its mean over a pixel, computed from
// areas and integrals without transfer functions.

// Share of a Gaussian below x.
inline double GaussianShare(double x, double sigma) {
  return sigma > 0 ? std::erfc(-x / (sigma * std::sqrt(2.0))) / 2 : (x > 0 ? 1 : 0);
}

// Share of a uniform disc below x: the area of a circular segment, R^2 (asin t + t sqrt(1 - t^2) +
// pi/2) with t = x/R, over that of the disc.
inline double DiscShare(double x, double radius) {
  const double t = std::clamp(x / radius, -1.0, 1.0);
  return 0.5 + (std::asin(t) + t * std::sqrt(1 - t * t)) / std::acos(-1.0);
}

// Share below x of a blur with the standard deviation sigma per axis.
inline double ShareBelow(model::Psf psf, double x, double sigma) {
  return psf == model::Psf::kDisc && sigma > 0 ? DiscShare(x, 2 * sigma) : GaussianShare(x, sigma);
}

// The mean of f over [-1/2, 1/2], by Simpson's rule on 2 `pairs` intervals.
template <typename Function>
double MeanOverPixel(const Function& f, int pairs) {
  double sum = f(-0.5) - f(0.5);
  for (int i = 0; i < pairs; ++i) {
    sum += 4 * f((2 * i + 1) / (2.0 * pairs) - 0.5) + 2 * f((i + 1.0) / pairs - 0.5);
  }
  return sum / (6 * pairs);
}

// Transfer functions at the frequency f, in cycles per px, of a pixel, a Gaussian and a uniform
// disc. The projection of the disc on the direction of the frequency is summed in `steps` parts.
inline double BoxTransfer(double f) {
  constexpr double kPi = 3.14159265358979323846;
  return f == 0 ? 1 : std::sin(kPi * f) / (kPi * f);
}
inline double GaussianTransfer(double sigma, double f) {
  constexpr double kPi = 3.14159265358979323846;
  return std::exp(-2 * kPi * kPi * sigma * sigma * f * f);
}
inline double DiscTransfer(double radius, double f, int steps = 200) {
  constexpr double kPi = 3.14159265358979323846;
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    const double phi = kPi * ((i + 0.5) / steps - 0.5);
    sum += std::pow(std::cos(phi), 2) * std::cos(2 * kPi * f * radius * std::sin(phi));
  }
  return 2 * sum / steps;
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_BLUR_ORACLES_H_
