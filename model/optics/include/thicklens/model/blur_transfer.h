#ifndef THICKLENS_MODEL_BLUR_TRANSFER_H_
#define THICKLENS_MODEL_BLUR_TRANSFER_H_

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"

namespace thicklens::model {

// Optical transfer functions in closed form [D31]. Lengths are in px of the sensor, frequencies in
// cycles per px. Every function is real, dimensionless and 1 at frequency 0.

// Transfer function of a Gaussian with the standard deviation sigma per axis:
// exp(-2 pi^2 sigma^2 (fx^2 + fy^2)).
THICKLENS_EXPORT double GaussianTransfer(double sigma_px, double fx, double fy);
// Transfer function of a uniform disc of radius R: 2 J1(2 pi R f)/(2 pi R f), f^2 = fx^2 + fy^2.
THICKLENS_EXPORT double DiscTransfer(double radius_px, double fx, double fy);
// Transfer function of the box of one pixel: sinc(fx) sinc(fy), sinc(x) = sin(pi x)/(pi x).
THICKLENS_EXPORT double PixelBoxTransfer(double fx, double fy);
// Transfer function of the defocus blur for its sigma per axis, kappa r_defocus/p. The PSF is a
// Gaussian of that sigma or a disc of radius 2 sigma.
THICKLENS_EXPORT double DefocusTransfer(Psf psf, double sigma_px, double fx, double fy);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_BLUR_TRANSFER_H_
