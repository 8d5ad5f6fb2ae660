#ifndef THICKLENS_CALIB_EDGE_BLUR_H_
#define THICKLENS_CALIB_EDGE_BLUR_H_

#include <opencv2/core/mat.hpp>
#include <optional>

namespace thicklens::calib {

// Blur of a frame at its edges after Zhuo & Sim 2011 [L6], as the supplement has it: the frame is
// blurred once more by a Gaussian of sigma0 = 1; at an ideal step edge of blur sigma the gradient
// falls by the ratio R = sqrt((sigma^2 + sigma0^2)/sigma^2), so sigma = sigma0/sqrt(R^2 - 1).
// Gradient magnitudes at the edge pixels as they are, the median over the edges. It includes the
// pixel box (1/12 px^2) and the blur of the difference operator (1/3 px^2), which is why it is
// nearly flat below 0.7 px.
struct SourceEdgeBlur {
  double sigma_px = 0;
  int edge_count = 0;
};
// Nothing where fewer than 12 edges are found. `grey` is CV_32F.
std::optional<SourceEdgeBlur> MeasureSourceEdgeBlur(const cv::Mat& grey);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGE_BLUR_H_
