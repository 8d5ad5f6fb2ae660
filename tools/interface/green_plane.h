#ifndef THICKLENS_TOOLS_INTERFACE_GREEN_PLANE_H_
#define THICKLENS_TOOLS_INTERFACE_GREEN_PLANE_H_

#include <string>

#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

// A calibration by the green sites of a mosaic. The measured image, the green plane, has one pixel
// for 2 x 2 px of the sensor, the mean of their two green sites, which is centred at (2 x + 0.5,
// 2 y + 0.5) px of the sensor.
//
// Light is averaged over the box of a pixel and over two sites that are +-0.5 px of the sensor from
// that centre, in each direction: along an axis they make a box of 2 px of the sensor, one pixel of
// the green plane. Its variance, 1/12 + 1/4 = 1/3 px^2 of the sensor, is therefore 1/12 px^2 of the
// green plane, which is what the estimators take for the pixel box of any image. Blur without the
// pixel box is the same blur in both units: kappa, d1 and the floor need no further correction.
// Along the diagonals the two sites differ from that box by a variance of +-1/4 px^2 of the sensor,
// a constant, which reaches the floor alone.
namespace thicklens {

// Returns the sweep as the green planes of its frames show it: the pixels, the region and the floor
// are those of the green plane, and `read_frame` is that of `sweep`.
calib::FocusSweep GreenPlaneSweep(const calib::FocusSweep& sweep);

// Converts what was measured on green planes into pixels of the sensor. Its texts have these
// already. The interval of a floor that was measured on edges is widened by the places of the
// sites.
void ConvertToSensorPixels(calib::Calibration* calibration);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_GREEN_PLANE_H_
