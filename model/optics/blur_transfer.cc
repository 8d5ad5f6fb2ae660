#include "thicklens/model/blur_transfer.h"

#include <math.h>  // ::j1 is POSIX; std::cyl_bessel_j is missing from some standard libraries

#include <cmath>

#include "thicklens/base/pi.h"

namespace thicklens::model {
namespace {

double Sinc(double x) {
  const double t = kPi * x;
  // sin(t)/t = 1 - t^2/6 + O(t^4): below 1e-4 the remainder is under 1e-17.
  return std::abs(t) < 1e-4 ? 1 - t * t / 6 : std::sin(t) / t;
}

}  // namespace

// The Fourier transform of the density of a unit-sum Gaussian, sigma in px per axis:
// exp(-2 pi^2 sigma^2 f^2). It is real and in (0, 1]; sigma = 0 gives 1.
double GaussianTransfer(double sigma_px, double fx, double fy) {
  return std::exp(-2 * kPi * kPi * sigma_px * sigma_px * (fx * fx + fy * fy));
}

// The Hankel transform of a unit-sum uniform disc, radius R in px: 2 J1(t)/t, t = 2 pi R f (the
// Airy amplitude). It is real, and negative beyond its first zero at R f = 0.61; R = 0 gives 1.
double DiscTransfer(double radius_px, double fx, double fy) {
  const double t = 2 * kPi * radius_px * std::hypot(fx, fy);
  // 2 J1(t)/t = 1 - t^2/8 + O(t^4)
  return t < 1e-4 ? 1 - t * t / 8 : 2 * ::j1(t) / t;
}

// The transfer function of the pixel's sensitive area, a box of 1 px x 1 px (fill factor 1).
double PixelBoxTransfer(double fx, double fy) { return Sinc(fx) * Sinc(fy); }

// A uniform disc of radius R has the second moment R^2/4 per axis, so that the disc of R = 2 sigma
// has the same sigma as the Gaussian.
double DefocusTransfer(Psf psf, double sigma_px, double fx, double fy) {
  return psf == Psf::kDisc ? DiscTransfer(2 * sigma_px, fx, fy)
                           : GaussianTransfer(sigma_px, fx, fy);
}

}  // namespace thicklens::model
