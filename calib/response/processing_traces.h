#ifndef THICKLENS_CALIB_RESPONSE_PROCESSING_TRACES_H_
#define THICKLENS_CALIB_RESPONSE_PROCESSING_TRACES_H_

#include <opencv2/core/types.hpp>
#include <optional>

#include "calib/response/response_frames.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// Measures the noise power of single pixels over that of 4 x 4 px, relative to white noise, minus
// 1 [D124]. Only frames whose blur is at least 6 px are used: what they show within a few pixels is
// noise, and what is left of the target lowers the value. The noise of a sensor is white, and
// demosaicing makes it smoother; only sharpening makes it rise toward fine detail. `least_noise` is
// the standard deviation, in linear light, below which the rounding of the file hides it. Returns
// nothing where fewer than 3 frames are blurred enough.
std::optional<model::Estimate> MeasureNoiseRise(const ResponseFrames& frames, cv::Size size,
                                                double least_noise);

// Measures the noise power of 2 x 2 px over that of 4 x 4 px, relative to white noise, in frames
// whose blur is at least 6 px [D142]. `step` is a step of the file in linear light: the variance of
// rounding, step^2/12, is taken out. A sensor has 1, demosaicing leaves 0.45 or more, and noise
// reduction, which averages over more pixels, leaves less. A frame is left out if rounding hides
// the noise of 4 x 4 px, or if 8 x 8 px have so much more power that it is the target's. Returns
// nothing for fewer than 3 frames.
std::optional<model::Estimate> MeasureNoiseSmoothness(const ResponseFrames& frames, cv::Size size,
                                                      double step);

// Measures the mean second difference across the borders of blocks of 8 x 8 px over that of other
// pixels, minus 1, at the place of the grid where it is largest [D125]. The smaller one of those of
// rows and columns counts, because a sensor that is read out in groups of columns has only one.
// Returns nothing for fewer than 3 frames.
std::optional<model::Estimate> MeasureBlockGrid(const ResponseFrames& frames, cv::Size size);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_RESPONSE_PROCESSING_TRACES_H_
