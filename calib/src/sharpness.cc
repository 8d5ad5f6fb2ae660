#include "thicklens/calib/sharpness.h"

#include <cmath>

#include "edge_pixels.h"

namespace thicklens::calib {
namespace {

float Interpolated(const cv::Mat& image, double x, double y) {
  const int x0 = static_cast<int>(std::floor(x));
  const int y0 = static_cast<int>(std::floor(y));
  const auto fx = static_cast<float>(x - x0);
  const auto fy = static_cast<float>(y - y0);
  const auto* upper = image.ptr<float>(y0) + x0;
  const auto* lower = image.ptr<float>(y0 + 1) + x0;
  return (1 - fy) * ((1 - fx) * upper[0] + fx * upper[1]) +
         fy * ((1 - fx) * lower[0] + fx * lower[1]);
}

struct Extremum {
  double distance_px = 0;
  double value = 0;
};

// Walks from an edge pixel in unit steps while the grey goes on rising (sign +1) or falling (-1).
Extremum Walk(const cv::Mat& image, cv::Point start, double dx, double dy, float sign, int max_px) {
  Extremum reached{0, image.at<float>(start)};
  for (int step = 1; step <= max_px; ++step) {
    const double x = start.x + step * dx;
    const double y = start.y + step * dy;
    if (!(x >= 0 && y >= 0 && x < image.cols - 1 && y < image.rows - 1)) break;
    const float value = Interpolated(image, x, y);
    if (!(sign * (value - static_cast<float>(reached.value)) > 0)) break;
    reached = {static_cast<double>(step), value};
  }
  return reached;
}

}  // namespace

SharpnessIndex MeanEdgeSlope(const cv::Mat& grey, const SharpnessOptions& options) {
  const cv::Mat smoothed = Smoothed(grey, options.smoothing_sigma_px);
  const Gradient gradient = CentralGradient(smoothed);
  SharpnessIndex index;
  double sum = 0;
  for (const cv::Point& edge : EdgePixels(gradient, options.edge_threshold, 2)) {
    const double magnitude = gradient.magnitude.at<float>(edge);
    const double dx = gradient.x.at<float>(edge) / magnitude;
    const double dy = gradient.y.at<float>(edge) / magnitude;
    const Extremum up = Walk(smoothed, edge, dx, dy, 1, options.max_search_px);
    const Extremum down = Walk(smoothed, edge, -dx, -dy, -1, options.max_search_px);
    const double distance_px = up.distance_px + down.distance_px;
    if (!(distance_px > 0)) continue;
    sum += std::abs(up.value - down.value) / distance_px;
    ++index.edge_count;
  }
  if (index.edge_count > 0) index.mean_edge_slope = sum / index.edge_count;
  return index;
}

}  // namespace thicklens::calib
