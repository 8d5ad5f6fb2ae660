#ifndef THICKLENS_CALIB_SPECTRUM_SPECTRAL_OPTIONS_H_
#define THICKLENS_CALIB_SPECTRUM_SPECTRAL_OPTIONS_H_

#include "calib/spectrum/relative_spectrum.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// The shape that is not stated.
model::Psf OtherPsf(model::Psf psf);

// 2 pi^2 dV nu^2 up to which modes are fitted: below a disc's first zero, and where a Gaussian has
// not sunk into the noise.
double UsualBand(model::Psf psf);

// The options that the camera's PSF asks for, at `part` of the usual band.
RelativeBlurOptions SpectralOptions(model::Psf psf, double floor_variance_px2, double part);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SPECTRUM_SPECTRAL_OPTIONS_H_
