#ifndef THICKLENS_CALIB_SWEEP_CLIPPING_H_
#define THICKLENS_CALIB_SWEEP_CLIPPING_H_

#include <opencv2/core/mat.hpp>

namespace thicklens::calib {

// Pixels that gather on the outermost value in use, as those of a clipping camera do.
struct Clipping {
  double fraction = 0;  // share of a channel's pixels; 0: none
  double level = 0;     // encoded value, in units of full scale
};

// The clipping at both ends, each from the channel that is clipped most. `noise_sigma` is the
// standard deviation of a linear grey pixel.
struct ClippingAtEnds {
  Clipping bright, dark;
};
ClippingAtEnds DetectClipping(const cv::Mat& stored, double noise_sigma);

// Whether the pixels at or below `level` (in units of full scale, in any channel) fill one side of
// a straight line: a backlit edge, of which one side is normally black.
bool IsBacklitEdge(const cv::Mat& stored, double level);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SWEEP_CLIPPING_H_
