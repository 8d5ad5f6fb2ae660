#ifndef THICKLENS_CALIB_REGISTRATION_SCALE_BEND_H_
#define THICKLENS_CALIB_REGISTRATION_SCALE_BEND_H_

#include <optional>
#include <vector>

#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/image_scale.h"

namespace thicklens::calib {

// The image scale goes as 1/z, but the readings bend against it: the rail's scale is not linear,
// the pictures are distorted, or the pupil moves with the reading (a lens that breathes).
struct Bend {
  // By how much the readings in the middle of the sweep lie off the straight line through its ends.
  model::Estimate bow_mm;
  // Bench zero that the farther half of the sweep alone would give, less that of the nearer half.
  double zero_spread_mm = 0;
};

// The curvature of the readings against 1/scale, if it lies beyond five standard deviations: of the
// readings' scatter, of the scales' own errors, of errors that neighbours share. Single wrong
// readings do not count. Nothing without a law, or from fewer than nine frames.
std::optional<Bend> FindBend(const std::vector<ScaleSample>& samples, const ScaleLaw& law,
                             const FocusSweep& sweep);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_SCALE_BEND_H_
