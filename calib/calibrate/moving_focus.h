#ifndef THICKLENS_CALIB_CALIBRATE_MOVING_FOCUS_H_
#define THICKLENS_CALIB_CALIBRATE_MOVING_FOCUS_H_

#include <functional>
#include <vector>

#include "calib/calibrate/focus_motion.h"
#include "calib/registration/image_scale.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// A sweep before its motion is known: the checks of the frames, their sharpness and scales.
struct SweepPreview {
  bool passed = false;               // false: `found` is refused
  Calibration found;                 // frames, sharpest reading
  std::vector<ScaleSample> samples;  // image scales against the readings
  std::size_t reference = 0;         // the sharpest frame
};

// The calibration of a target that moves, by which a sweep of a moving lens or sensor is solved.
struct TargetCalibration {
  std::function<SweepPreview(const FocusSweep& sweep)> preview;
  // Calibrates the equivalent sweep of a motion.
  std::function<Calibration(const FocusSweep& equivalent, const FocusMotion& motion)> run;
};

// Calibrates a sweep in which `moves`, the lens or the sensor, moves and the target stands still.
// The frames are those of an equivalent target (FocusMotion), whose calibration is converted: d1,
// zf and the magnification are those of the reading at focus, and
//   d1(reading) = d1 + s (reading - reading at focus)
// gives d1 of each position. xf comes from the readings if they are focus distances, otherwise from
// what is stated (the most precise of the statements about the plane of focus and offset_mm), or
// from the image scale where that is at least twice as good; the others are compared with it. If
// the sensor moves, the scale is proportional to D and 0 at D = 0; if the lens moves, the scale
// depends on xf only to second order, because d ln(scale)/d reading = 1/f for a thin lens at any
// magnification, and a short sweep does not determine xf.
Calibration CalibrateMovingFocus(const FocusSweep& sweep, model::SweepMotion moves,
                                 const TargetCalibration& target);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_MOVING_FOCUS_H_
