#ifndef THICKLENS_CALIB_CALIBRATE_TARGET_CALIBRATION_H_
#define THICKLENS_CALIB_CALIBRATE_TARGET_CALIBRATION_H_

#include "calib/calibrate/focus_motion.h"
#include "calib/calibrate/moving_focus.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Calibrates from a sweep whose target (or whole camera) moves. With `motion`, the sweep is the
// equivalent one of a lens or a sensor that moves.
Calibration CalibrateTarget(const FocusSweep& sweep, const CalibrationOptions& options,
                            const FocusMotion* motion = nullptr);

// Measures sharpness and image scale of the frames alone.
SweepPreview PreviewTarget(const FocusSweep& sweep, const CalibrationOptions& options);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_TARGET_CALIBRATION_H_
