#ifndef THICKLENS_CALIB_REGISTRATION_RADIAL_DISTORTION_H_
#define THICKLENS_CALIB_REGISTRATION_RADIAL_DISTORTION_H_

#include <optional>
#include <vector>

#include "calib/registration/image_scale.h"

namespace thicklens::calib {

// Response of the cubic term of a registration to radial distortion. Let every frame have x' = X (1
// + k X^2), where X is the position that a pinhole would give. A frame of scale s then shows at R
// what the reference shows at R/s and, to first order in k, is displaced beyond s by k (R^3 -
// R^3/s^2), so that cubic = k (1 - 1/s^2). Derived here [D62]; k is in px^-2, positive for
// pincushion distortion. At s = 1 the distortion is not visible.
double CubicPerDistortion(double scale);

// A measured value that is proportional to a response.
struct ProportionalTerm {
  double response, value, sigma;
};

// Fits the factor k of value = k response, robust against single outliers, with the larger of its
// formal error and of a jackknife over runs of terms with neighbouring responses: frames of nearly
// equal scale share the errors of the reference. Returns std::nullopt for fewer than five terms.
std::optional<model::Estimate> FitProportion(const std::vector<ProportionalTerm>& terms);

// Returns whether responses, with their standard deviations, exceed these errors by so much that a
// factor can be fitted to them: the sum of their squares is more than 16 times that of the errors.
bool ExceedErrors(const std::vector<model::Estimate>& responses);

// Fits k to the cubic terms of a sweep's registrations, robust against single outliers. Returns
// std::nullopt for fewer than five samples, and where their scales differ by no more than their
// errors.
std::optional<model::Estimate> FitRadialDistortion(const std::vector<ScaleSample>& samples);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_RADIAL_DISTORTION_H_
