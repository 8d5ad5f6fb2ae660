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
  const Gradient sharp = CentralGradient(grey);
  const Gradient reblurred = CentralGradient(Smoothed(grey, 1));
  std::vector<double> sigmas;
  for (const cv::Point& edge : EdgePixels(sharp, 0.5 * Quantile(sharp.magnitude, 0.995), 8)) {
    const double ratio = sharp.magnitude.at<float>(edge) / reblurred.magnitude.at<float>(edge);
    if (ratio > 1 && std::isfinite(ratio)) sigmas.push_back(1 / std::sqrt(ratio * ratio - 1));
  }
  if (sigmas.size() < kMinEdges) return std::nullopt;
  return SourceEdgeBlur{Median(sigmas), static_cast<int>(sigmas.size())};
}

}  // namespace thicklens::calib
