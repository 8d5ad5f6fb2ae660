#ifndef THICKLENS_CALIB_SPECTRUM_SPECTRAL_OPTIONS_H_
#define THICKLENS_CALIB_SPECTRUM_SPECTRAL_OPTIONS_H_

#include "calib/spectrum/relative_spectrum.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// The other shape than the stated one.
model::Psf OtherPsf(model::Psf psf);

// Limit of 2 pi^2 dV nu^2 for the fitted modes. It is below the first zero of a disc, and low
// enough that a Gaussian is still above the noise.
double UsualBand(model::Psf psf);

// The options for the camera's PSF, with `part` of the usual band.
RelativeBlurOptions SpectralOptions(model::Psf psf, double floor_variance_px2, double part);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SPECTRUM_SPECTRAL_OPTIONS_H_
