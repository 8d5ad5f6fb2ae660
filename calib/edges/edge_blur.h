#ifndef THICKLENS_CALIB_EDGES_EDGE_BLUR_H_
#define THICKLENS_CALIB_EDGES_EDGE_BLUR_H_

#include <opencv2/core/mat.hpp>
#include <optional>

namespace thicklens::calib {

// Blur of a frame at its edges after Zhuo & Sim 2011 [L6], as the paper (the supplement) uses it.
// The frame is blurred once more by a Gaussian of sigma0 = 1 px. At an ideal step edge of blur
// sigma the gradient falls by the ratio R = sqrt((sigma^2 + sigma0^2)/sigma^2), so sigma =
// sigma0/sqrt(R^2 - 1). The gradient magnitudes are taken at the edge pixels without interpolation;
// the result is the median over the edge pixels. It includes the pixel box (1/12 px^2) and the blur
// of the difference operator (1/3 px^2), and is therefore nearly flat below 0.7 px.
struct SourceEdgeBlur {
  double sigma_px = 0;
  int edge_count = 0;
};
// Measures the blur of `grey` (CV_32F). Returns std::nullopt where fewer than 12 edge pixels give a
// blur.
std::optional<SourceEdgeBlur> MeasureSourceEdgeBlur(const cv::Mat& grey);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGES_EDGE_BLUR_H_
