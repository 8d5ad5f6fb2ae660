#ifndef THICKLENS_CALIB_CALIBRATE_TARGET_CALIBRATION_H_
#define THICKLENS_CALIB_CALIBRATE_TARGET_CALIBRATION_H_

#include "calib/calibrate/focus_motion.h"
#include "calib/calibrate/moving_focus.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Stages of a calibration in its progress, with one step per frame each: statistics, sharpness,
// scale, blur, the map of the field, and the relief of the target (WithoutRelief).
inline constexpr int kStagesOfProgress = 6;

// Calibrates from a sweep whose target (or whole camera) moves. With `motion`, the sweep is the
// equivalent one of a lens or a sensor that moves.
Calibration CalibrateTarget(const FocusSweep& sweep, const CalibrationOptions& options,
                            const FocusMotion* motion = nullptr);

// Measures sharpness and image scale of the frames alone.
SweepPreview PreviewTarget(const FocusSweep& sweep, const CalibrationOptions& options);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_TARGET_CALIBRATION_H_
