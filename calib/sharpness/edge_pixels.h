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

// The magnitude alone, for which no matrix of both parts is needed.
cv::Mat GradientMagnitude(const cv::Mat& grey);
// The gradient at a pixel that is not on the border.
cv::Point2f GradientAt(const cv::Mat& grey, cv::Point pixel);

// Returns the pixels whose gradient magnitude exceeds the threshold and is the largest along the
// gradient's direction (non-maximum suppression). They are at least `margin_px` from the border.
// `magnitude` is that of `grey`.
std::vector<cv::Point> EdgePixels(const cv::Mat& grey, const cv::Mat& magnitude, double threshold,
                                  int margin_px);

// Returns the value below which a fraction of a CV_32F matrix lies.
double Quantile(const cv::Mat& values, double fraction);

// Gaussian smoothing of a CV_32F frame. sigma must be >= 0.8 px, where a sampled kernel has the
// intended variance.
cv::Mat Smoothed(const cv::Mat& grey, double sigma_px);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SHARPNESS_EDGE_PIXELS_H_
