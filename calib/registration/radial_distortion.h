#ifndef THICKLENS_CALIB_REGISTRATION_RADIAL_DISTORTION_H_
#define THICKLENS_CALIB_REGISTRATION_RADIAL_DISTORTION_H_

#include <optional>
#include <vector>

#include "thicklens/calib/image_scale.h"

namespace thicklens::calib {

// How the cubic term of a registration answers to radial distortion. Where every frame has
// x' = X (1 + k X^2), X the place that a pinhole would give, a frame of scale s shows at R what the
// reference shows at R/s and, to first order in k, is displaced beyond s by k (R^3 - R^3/s^2):
// cubic = k (1 - 1/s^2). Derived here [D62]; k in px^-2, pincushion positive. At s = 1 it cannot be
// seen.
double CubicPerDistortion(double scale);

// k from the cubic terms of a sweep's registrations, robust against single wrong ones. Nothing from
// fewer than five.
std::optional<model::Estimate> FitRadialDistortion(const std::vector<ScaleSample>& samples);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_RADIAL_DISTORTION_H_
