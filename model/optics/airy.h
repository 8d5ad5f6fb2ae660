#ifndef THICKLENS_MODEL_OPTICS_AIRY_H_
#define THICKLENS_MODEL_OPTICS_AIRY_H_

#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::model {

// Diffraction at the aperture [L2], incoherent, in the plane of focus (Born and Wolf, Principles of
// Optics, 8.5.2), with the sensor at D = d1 - rho from the rear principal plane, where the
// aperture's image has the aperture's own size.
//   disc of radius R = 2 kappa r: the Airy pattern, share of the light within the radius x
//     1 - J0(v)^2 - J1(v)^2, v = 2 pi R x/(lambda D); its first dark ring at
//     .6098 lambda D/R holds 83.8 %
//   Gaussian whose transmission of light has the standard deviation s = kappa r: the field's is
//     sqrt(2) s, and its Fourier transform squared a Gaussian of lambda D/(4 pi s). Derived here
//     [D36].

// The radius that holds 83.8 % of the light, px of the sensor; 0 of an aperture without size, of
// which nothing can be told.
double AiryRadiusPx(const Camera& camera, double wavelength_mm);

// That radius of a Gaussian of sigma 1 per axis: sqrt(-2 log(1 - .838)).
constexpr double kGaussianAiryRadius = 1.9078;

// Of a disc's light the distances that shares of (i + 1/2)/count do not pass, in Airy radii. The
// pattern's last 0.3 %, which lies beyond 50 of them, is put there.
std::vector<double> AiryQuantiles(int count);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_OPTICS_AIRY_H_
