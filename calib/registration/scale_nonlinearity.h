#ifndef THICKLENS_CALIB_REGISTRATION_SCALE_NONLINEARITY_H_
#define THICKLENS_CALIB_REGISTRATION_SCALE_NONLINEARITY_H_

#include <optional>
#include <vector>

#include "calib/registration/image_scale.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// A systematic bend of the readings against an image scale that is proportional to 1/z. The rail's
// scale is not linear, the images are distorted, or the pupil moves with the reading (a lens that
// breathes).
struct ScaleNonlinearity {
  // Distance of the readings in the middle of the sweep from the straight line through its ends.
  model::Estimate bow_mm;
  // Bench offset from the farther half of the sweep alone minus that from the nearer half.
  double zero_spread_mm = 0;
};

// Finds the curvature of the readings against 1/scale. Returns it if it lies beyond five standard
// deviations, which include the scatter of the readings, the scales' own errors, and errors that
// neighbours share. Single outliers among the readings do not affect it. Returns std::nullopt
// without a law, or for fewer than nine frames.
std::optional<ScaleNonlinearity> FindScaleNonlinearity(const std::vector<ScaleSample>& samples,
                                                       const ScaleModel& law,
                                                       const FocusSweep& sweep);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_SCALE_NONLINEARITY_H_
