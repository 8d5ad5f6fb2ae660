#include "calib/edges/edge_blur.h"

#include <cmath>
#include <vector>

#include "calib/sharpness/edge_pixels.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr int kMinEdges = 12;

}  // namespace

std::optional<SourceEdgeBlur> MeasureSourceEdgeBlur(const cv::Mat& grey) {
  const cv::Mat sharp = GradientMagnitude(grey);
  const cv::Mat reblurred = Smoothed(grey, 1);
  std::vector<double> sigmas;
  for (const cv::Point& edge : EdgePixels(grey, sharp, 0.5 * Quantile(sharp, 0.995), 8)) {
    const cv::Point2f left = GradientAt(reblurred, edge);
    const double ratio = sharp.at<float>(edge) / std::sqrt(left.x * left.x + left.y * left.y);
    if (ratio > 1 && std::isfinite(ratio)) sigmas.push_back(1 / std::sqrt(ratio * ratio - 1));
  }
  if (sigmas.size() < kMinEdges) return std::nullopt;
  return SourceEdgeBlur{Median(sigmas), static_cast<int>(sigmas.size())};
}

}  // namespace thicklens::calib
