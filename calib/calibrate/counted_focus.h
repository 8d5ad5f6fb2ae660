#ifndef THICKLENS_CALIB_CALIBRATE_COUNTED_FOCUS_H_
#define THICKLENS_CALIB_CALIBRATE_COUNTED_FOCUS_H_

#include "calib/calibrate/moving_focus.h"

namespace thicklens::calib {

// Calibrates a sweep whose readings are counts of a drive of the lens or the sensor, of unknown
// length g: D = xf + s g (count - count at focus) [D147]. The image scale shows g/u per count
// (u as in FocusMotion, which depends on xf and zf), so that it gives g where a statement about the
// plane of focus gives xf; the law of the light over the pupil changes the growth by up to some
// percent. The sweep is then one in mm, and the results are those of counts again:
// the readings of the frames and of focus, the positions, and the growth of the blur per count.
// Without a statement the sweep is refused with what is determined: the count at focus, the growth
// of the blur, and the share by which the scale changes per count.
Calibration CalibrateCountedFocus(const FocusSweep& sweep, model::SweepMotion moves,
                                  const TargetCalibration& target);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_COUNTED_FOCUS_H_
