#ifndef THICKLENS_CALIB_SHARPNESS_SHARPEST_READING_H_
#define THICKLENS_CALIB_SHARPNESS_SHARPEST_READING_H_

#include <cstddef>
#include <vector>

#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

// Finds the peak of a parabola through the logarithm of the normalised sharpness against the
// reading. The parabola is fitted to the contiguous frames around the largest index that reach 80 %
// of it (at least five). sigma combines three parts: the scatter about the parabola; the shift of
// the peak where frames down to 60 % are included, because the curve is no exact parabola; and the
// distance to the peak of the steepest gradients (99.5th percentile over the mean), because behind
// an aberrated lens each measure of sharpness has a peak of its own. A curve that still rises at an
// end of the sweep has no peak.
SharpestReading FindSharpestReading(const std::vector<FrameMeasurement>& frames,
                                    const std::vector<std::size_t>& used);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SHARPNESS_SHARPEST_READING_H_
