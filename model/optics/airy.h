#ifndef THICKLENS_MODEL_OPTICS_AIRY_H_
#define THICKLENS_MODEL_OPTICS_AIRY_H_

#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::model {

// Diffraction at the aperture [L2], incoherent, in the plane of focus (Born and Wolf, Principles of
// Optics, 8.5.2). The sensor is at D = d1 - rho from the rear principal plane, where the image of
// the aperture has the size of the aperture itself.
//   Disc of radius R = 2 kappa r: the Airy pattern. The share of the light within the radius x is
//     1 - J0(v)^2 - J1(v)^2, v = 2 pi R x/(lambda D). The first dark ring at 0.6098 lambda D/R
//     contains 83.8 %.
//   Gaussian whose transmission of light has the standard deviation s = kappa r: the field's
//     standard deviation is sqrt(2) s, and the squared Fourier transform of the field is a Gaussian
//     with the standard deviation lambda D/(4 pi s). Derived here [D36].

// Radius that contains 83.8 % of the light, px of the sensor. It is 0 for an aperture without size,
// for which it is undefined. Throws Error if the camera lacks its blur ratio or image distance.
double AiryRadiusPx(const Camera& camera, double wavelength_mm);

// Radius that contains 83.8 % of a Gaussian of sigma 1 per axis: sqrt(-2 log(1 - 0.838)).
constexpr double kGaussianAiryRadius = 1.9078;

// Quantiles of the Airy pattern of a disc: element i is the radius, in Airy radii, that contains
// the share (i + 1/2)/count of the light. The last 0.3 % of the light, which is beyond 50 Airy
// radii, is placed at 50.
std::vector<double> AiryQuantiles(int count);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_OPTICS_AIRY_H_
