#ifndef THICKLENS_CALIB_SHARPNESS_EDGE_PIXELS_H_
#define THICKLENS_CALIB_SHARPNESS_EDGE_PIXELS_H_

#include <opencv2/core/mat.hpp>
#include <vector>

namespace thicklens::calib {

// Gradient by central differences, grey per px, CV_32F. The outermost rows and columns are 0.
struct Gradient {
  cv::Mat x, y, magnitude;
};
Gradient CentralGradient(const cv::Mat& grey);

// Returns the pixels whose gradient magnitude exceeds the threshold and is the largest along the
// gradient's direction (non-maximum suppression). They are at least `margin_px` from the border.
std::vector<cv::Point> EdgePixels(const Gradient& gradient, double threshold, int margin_px);

// Returns the value below which a fraction of a CV_32F matrix lies.
double Quantile(const cv::Mat& values, double fraction);

// Gaussian smoothing of a CV_32F frame. sigma must be >= 0.8 px, where a sampled kernel has the
// intended variance.
cv::Mat Smoothed(const cv::Mat& grey, double sigma_px);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SHARPNESS_EDGE_PIXELS_H_
