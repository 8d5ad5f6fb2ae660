#include "calib/edges/lone_edge.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "calib/sharpness/edge_pixels.h"

namespace thicklens::calib {
namespace {

constexpr double kSmoothingPx = 1.5;
constexpr double kThreshold = 0.25;  // of the steepest gradient
constexpr double kTopQuantile = 0.999;
constexpr int kMarginPx = 3;
constexpr double kFromLinePx = 2;   // rms distance of the pixels from the line
constexpr double kMinLength = 0.5;  // of the shorter side
constexpr double kMinFilled = 0.5;  // pixels per px of the length

}  // namespace

bool ShowsLoneEdge(const cv::Mat& grey) {
  if (std::min(grey.cols, grey.rows) < 4 * kMarginPx) return false;
  const cv::Mat smoothed = Smoothed(grey, kSmoothingPx);
  const cv::Mat magnitude = GradientMagnitude(smoothed);
  const double steepest = Quantile(magnitude, kTopQuantile);
  const std::vector<cv::Point> pixels =
      EdgePixels(smoothed, magnitude, kThreshold * steepest, kMarginPx);
  if (pixels.size() < 8) return false;
  Eigen::Vector2d mean(0, 0);
  for (const cv::Point& p : pixels) mean += Eigen::Vector2d(p.x, p.y);
  mean /= static_cast<double>(pixels.size());
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for (const cv::Point& p : pixels) {
    const Eigen::Vector2d from_mean = Eigen::Vector2d(p.x, p.y) - mean;
    spread += from_mean * from_mean.transpose();
  }
  spread /= static_cast<double>(pixels.size());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(spread);
  if (!(std::sqrt(std::max(0.0, axes.eigenvalues()[0])) < kFromLinePx)) return false;
  // A line of evenly spread pixels has the variance length^2/12 along itself.
  const double length_px = std::sqrt(12 * axes.eigenvalues()[1]);
  return length_px > kMinLength * std::min(grey.cols, grey.rows) &&
         static_cast<double>(pixels.size()) > kMinFilled * length_px;
}

}  // namespace thicklens::calib
