#ifndef THICKLENS_CALIB_CALIBRATE_RELIEF_REGION_H_
#define THICKLENS_CALIB_CALIBRATE_RELIEF_REGION_H_

#include <functional>

#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Looks for a relief of the target in a finished calibration of a sweep whose target or camera
// moves. Where the zones of the field show one, the calibration is repeated by `run` on the largest
// rectangle at one depth, and its result is returned with the depths of the others; where no
// rectangle suffices, a refusal with the map of the depths. Otherwise `found` is returned with what
// was seen.
Calibration WithoutRelief(const FocusSweep& sweep, const CalibrationOptions& options,
                          Calibration found,
                          const std::function<Calibration(const FocusSweep&)>& run);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_RELIEF_REGION_H_
