#ifndef THICKLENS_CALIB_CALIBRATE_SWEEP_CONDITIONS_H_
#define THICKLENS_CALIB_CALIBRATE_SWEEP_CONDITIONS_H_

#include <vector>

#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/sweep_plan.h"

namespace thicklens::calib {

// The conditions of a plan that the frames of a sweep show: light, contrast and noise. The sensor
// is the region, and at most kConditionsPx of it, so that a prediction takes milliseconds: it is
// the most that the errors of a larger region are. `frames` are at least one. The blur floor is
// taken as known, and the errors of readings and bench offset are left to the caller.
inline constexpr int kConditionsPx = 480;
PlanConditions ConditionsOfFrames(const FocusSweep& sweep,
                                  const std::vector<const FrameMeasurement*>& frames,
                                  double focus_depth_mm, double blur_ratio);

// Radius of the smallest discs of the texture that is taken for an unknown target, mm.
double UsualTextureMm(const PlanConditions& conditions);

// A sweep goes at most to this depth, in units of zf.
inline constexpr double kFarthestDepth = 3;
// The nearest depth of a sweep, mm from Ap: a part of zf - f1 beyond the focal length.
double NearestDepthMm(const PlanConditions& conditions);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_SWEEP_CONDITIONS_H_
