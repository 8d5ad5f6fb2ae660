#include "estimator/views/surface_taps.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace thicklens::estimator {

double SurfaceTolerance(const DisparityMap& map) {
  constexpr double kSameSurfacePx = 0.3;
  return kSameSurfacePx / map.step.cwiseAbs().maxCoeff();
}

SurfaceTaps TapsAt(const DisparityMap& map, double tolerance, double x, double y, float disparity) {
  const double inside_x = std::clamp(x, 0.0, map.width_px - 1.0);
  const double inside_y = std::clamp(y, 0.0, map.height_px - 1.0);
  const int x0 = static_cast<int>(inside_x), y0 = static_cast<int>(inside_y);
  const double fx = inside_x - x0, fy = inside_y - y0;
  SurfaceTaps taps;
  double sum = 0, closest = std::numeric_limits<double>::infinity();
  std::size_t closest_pixel = 0;
  for (int corner = 0; corner < 4; ++corner) {
    const int i = corner % 2, j = corner / 2;
    const double weight = (i == 0 ? 1 - fx : fx) * (j == 0 ? 1 - fy : fy);
    if (weight == 0) continue;  // the tap may be outside of the image
    const std::size_t pixel =
        static_cast<std::size_t>(y0 + j) * static_cast<std::size_t>(map.width_px) +
        static_cast<std::size_t>(x0 + i);
    const double difference = std::abs(static_cast<double>(map.disparity[pixel]) - disparity);
    if (difference < closest) {
      closest = difference;
      closest_pixel = pixel;
    }
    if (!(difference <= tolerance)) continue;
    taps.pixel[static_cast<std::size_t>(taps.count)] = pixel;
    taps.weight[static_cast<std::size_t>(taps.count)] = weight;
    ++taps.count;
    sum += weight;
  }
  if (taps.count == 0) {
    taps.count = 1;
    taps.pixel[0] = closest_pixel;
    taps.weight[0] = 1;
    return taps;
  }
  for (int t = 0; t < taps.count; ++t) taps.weight[static_cast<std::size_t>(t)] /= sum;
  return taps;
}

}  // namespace thicklens::estimator
