#include "calib/spectrum/spectral_transfer.h"

#include <cmath>

#include "thicklens/base/pi.h"

namespace thicklens::calib {
namespace {

constexpr double kTwoPiSquared = 2 * kPi * kPi;

// [D78] A disc's transfer function of v = (R/2)^2, its variance per axis, and d ln/dv. It is
// analytic through v = 0, so that noise may make v negative.
//   D = 2 J1(x)/x, x = 4 pi nu sqrt(v); dD/dv = -(J2(x)/x) 4 pi nu/sqrt(v).
TransferAndSlope Disc(double v, double nu) {
  const double x2 = 16 * kPi * kPi * nu * nu * v;
  const double dx2 = 16 * kPi * kPi * nu * nu;
  if (x2 < 1) {
    const double value = 1 + x2 * (-1.0 / 8 + x2 * (1.0 / 192 - x2 / 9216));
    const double slope = -1.0 / 8 + x2 * (1.0 / 96 - x2 / 3072);
    if (x2 < -20) return {std::exp(-x2 / 8), -dx2 / 8};
    return {value, slope * dx2 / value};
  }
  const double x = std::sqrt(x2);
  const double value = 2 * ::j1(x) / x;
  const double slope = -::jn(2, x) / x2;  // dD/d(x^2)
  return {value, slope * dx2 / value};
}

}  // namespace

TransferAndSlope SpectralTransfer(model::Psf psf, double floor_variance_px2, double variance_px2,
                                  double scale, double nu) {
  if (psf == model::Psf::kGaussian) {
    return {std::exp(-kTwoPiSquared * variance_px2 * nu * nu), -kTwoPiSquared * nu * nu};
  }
  const double floor = floor_variance_px2 / (scale * scale);
  TransferAndSlope disc = Disc(variance_px2 - floor, nu);
  disc.value *= std::exp(-kTwoPiSquared * floor * nu * nu);
  return disc;
}

}  // namespace thicklens::calib
