#ifndef THICKLENS_CALIB_CALIBRATE_RECOGNISED_TARGET_H_
#define THICKLENS_CALIB_CALIBRATE_RECOGNISED_TARGET_H_

#include <functional>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/frame_checks.h"

namespace thicklens::calib {

// Decides from the frame with the steepest gradients what the target is, where it is not stated:
// only points, or only one straight edge, which is taken as a printed one. A stated texture
// that is such an edge has no spectra, and is taken as one. A warning says what was decided.
void RecogniseTarget(const std::function<cv::Mat(std::size_t)>& read_grey, FocusSweep* sweep,
                     Calibration* calibration);

// Adapts the quality checks to the target: an edge or the ground between points may be black, and
// points lose their contrast faster than a texture.
QualityCheckOptions ChecksFor(model::SweepTarget target, QualityCheckOptions checks);

// Whether the target covers so little of the frame that neither bands of the light nor what is
// fixed to the frame can be found beside it: an edge, or points.
bool IsSparse(model::SweepTarget target);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_RECOGNISED_TARGET_H_
