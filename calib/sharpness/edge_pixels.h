#ifndef THICKLENS_CALIB_SHARPNESS_EDGE_PIXELS_H_
#define THICKLENS_CALIB_SHARPNESS_EDGE_PIXELS_H_

#include <opencv2/core/mat.hpp>
#include <vector>

namespace thicklens::calib {

// Gradient by central differences, grey per px, CV_32F; the outermost row and column are 0.
struct Gradient {
  cv::Mat x, y, magnitude;
};
Gradient CentralGradient(const cv::Mat& grey);

// Pixels whose gradient magnitude exceeds the threshold and is the largest along the gradient's
// direction (non-maximum suppression), at least `margin_px` from the border.
std::vector<cv::Point> EdgePixels(const Gradient& gradient, double threshold, int margin_px);

// The value below which a fraction of a CV_32F matrix lies.
double Quantile(const cv::Mat& values, double fraction);

// Gaussian smoothing of a CV_32F frame; sigma >= 0.8 px, where a sampled kernel has the variance it
// should have.
cv::Mat Smoothed(const cv::Mat& grey, double sigma_px);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SHARPNESS_EDGE_PIXELS_H_
