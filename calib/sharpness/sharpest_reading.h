#ifndef THICKLENS_CALIB_SHARPNESS_SHARPEST_READING_H_
#define THICKLENS_CALIB_SHARPNESS_SHARPEST_READING_H_

#include <cstddef>
#include <vector>

#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

// A parabola through the logarithm of the normalised sharpness against the reading, over the
// contiguous frames about the largest that reach 80 % of it (at least five). sigma is from the
// scatter about the parabola, from how far the peak moves where frames down to 60 % are taken too,
// because the curve is no exact parabola, and from where the steepest gradients (99.5 percentile
// over the mean) have theirs: behind an aberrated lens each measure of sharpness has a peak of its
// own. A curve that still rises at an end of the sweep has no peak.
SharpestReading FindSharpestReading(const std::vector<FrameMeasurement>& frames,
                                    const std::vector<std::size_t>& used);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SHARPNESS_SHARPEST_READING_H_
