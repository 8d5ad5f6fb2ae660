#ifndef THICKLENS_CALIB_UNCERTAINTY_SYSTEMATIC_PARTS_H_
#define THICKLENS_CALIB_UNCERTAINTY_SYSTEMATIC_PARTS_H_

#include <optional>
#include <string>

#include "calib/fit/blur_measurement.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// The uncertainty of the floor: an interval of S0, px^2, or nothing.
using FloorInterval = std::optional<Eigen::Vector2d>;

// Fits each side of focus alone, with the target's softness held at the fit's value, as a
// self-test.
void FitSides(const BlurEvidence& evidence, const BlurFitResult& fit, Calibration* calibration);

// Tries every alternative choice (floor, side, band, shape, estimator, the camera's stated
// tolerances) and records how far it moves each result. Fills in the systematic intervals, the
// table of parts and the advice.
void AddSystematicParts(const FocusSweep& sweep, const BlurEvidence& evidence,
                        const BlurFitResult& fit, const FloorInterval& floor,
                        Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_SYSTEMATIC_PARTS_H_
