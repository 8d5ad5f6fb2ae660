#ifndef THICKLENS_CALIB_SHARPNESS_SHARPNESS_PEAK_H_
#define THICKLENS_CALIB_SHARPNESS_SHARPNESS_PEAK_H_

#include <vector>

#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

// One frame's depth from Ap and its sharpness index.
struct SharpnessSample {
  double depth_mm = 0;
  double index = 0;
};

// Finds the peak of a parabola through the logarithm of the index against 1/z. The parabola is
// fitted to the contiguous frames around the largest index that reach 80 % of it (at least five).
// sigma follows from the scatter about the parabola.
SharpnessPeak FitSharpnessPeak(std::vector<SharpnessSample> samples);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SHARPNESS_SHARPNESS_PEAK_H_
