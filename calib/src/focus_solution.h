#ifndef THICKLENS_CALIB_SRC_FOCUS_SOLUTION_H_
#define THICKLENS_CALIB_SRC_FOCUS_SOLUTION_H_

#include <vector>

#include "blur_fit.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {

// From the blur of the frames to the results: chooses what is known of the floor, fits, takes the
// systematic interval from what is not known, and decides the outcome. Reads the gates, depths and
// sharpness out of `calibration` and fills in the rest. `absolute` says whether the samples are
// absolute variances (isolated edges) or relative to frame `reference`.
void SolveFocus(const FocusSweep& sweep, const std::vector<BlurSample>& samples, bool absolute,
                std::size_t reference, Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SRC_FOCUS_SOLUTION_H_
