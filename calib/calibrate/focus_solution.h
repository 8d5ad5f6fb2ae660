#ifndef THICKLENS_CALIB_CALIBRATE_FOCUS_SOLUTION_H_
#define THICKLENS_CALIB_CALIBRATE_FOCUS_SOLUTION_H_

#include "calib/fit/blur_measurement.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// From the blur of the frames to the results: throws out frames that do not follow (named in their
// `rejection`), chooses what is known of the floor, fits, takes the systematic interval from what
// is not known, and decides the outcome. Reads gates, depths and sharpness out of `calibration` and
// fills in the rest. On return `evidence` holds the frames that were used, the floor that was
// assumed and, in `fit`, the answer.
void SolveFocus(const FocusSweep& sweep, BlurEvidence* evidence, BlurFitResult* fit,
                Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_FOCUS_SOLUTION_H_
