#ifndef THICKLENS_MODEL_BLUR_TRANSFER_H_
#define THICKLENS_MODEL_BLUR_TRANSFER_H_

#include "thicklens/model/camera.h"

namespace thicklens::model {

// Optical transfer functions in closed form [D31]; frequencies in cycles per px, 1 at frequency 0.

// exp(-2 pi^2 sigma^2 (fx^2 + fy^2)).
double GaussianTransfer(double sigma_px, double fx, double fy);
// 2 J1(2 pi R f)/(2 pi R f) of a uniform disc of radius R.
double DiscTransfer(double radius_px, double fx, double fy);
// sinc(fx) sinc(fy) of the pixel's own box of one pixel.
double PixelBoxTransfer(double fx, double fy);
// Defocus by the camera's PSF for the per-axis sigma kappa r_defocus/p: a Gaussian of that sigma,
// or a disc of radius 2 sigma.
double DefocusTransfer(Psf psf, double sigma_px, double fx, double fy);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_BLUR_TRANSFER_H_
