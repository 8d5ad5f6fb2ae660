#ifndef THICKLENS_CALIB_CALIBRATE_FOCUS_SOLUTION_H_
#define THICKLENS_CALIB_CALIBRATE_FOCUS_SOLUTION_H_

#include "calib/calibrate/focus_motion.h"
#include "calib/fit/blur_measurement.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Standard deviations by which the in-focus object distance must exceed the focal length, and kappa
// 0, so that d1 and kappa are determined.
inline constexpr double kKnownSigmas = 3;

// Derives the results from the blur of the frames. It rejects frames that do not follow the others
// (they are named in their `rejection`), chooses the floor's constraint, fits, estimates the
// systematic interval from the unknown quantities, and decides the outcome. It reads quality
// checks, depths and sharpness from `calibration` and fills in the rest. On return `evidence` holds
// the used frames and the assumed floor, and `fit` holds the fit.
// With `motion`, the sweep is the equivalent one of that motion, and messages state its readings in
// place of depths; otherwise it is null.
void SolveFocus(const FocusSweep& sweep, BlurEvidence* evidence, BlurFitResult* fit,
                Calibration* calibration, const FocusMotion* motion = nullptr);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_FOCUS_SOLUTION_H_
