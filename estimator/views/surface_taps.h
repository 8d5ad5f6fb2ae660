#ifndef THICKLENS_ESTIMATOR_VIEWS_SURFACE_TAPS_H_
#define THICKLENS_ESTIMATOR_VIEWS_SURFACE_TAPS_H_

#include <array>
#include <cstddef>

#include "thicklens/estimator/disparity_map.h"

namespace thicklens::estimator {

// Returns the largest difference of the disparities of one surface, in the unit of the map (0.3 px
// per view step); infinite where the steps are 0.
double SurfaceTolerance(const DisparityMap& map);

// Interpolation of the image on one surface: up to four pixels and their weights, sum 1.
struct SurfaceTaps {
  int count = 0;
  std::array<std::size_t, 4> pixel{};
  std::array<double, 4> weight{};
};
// Returns the bilinear taps at (x, y), clamped to the image, whose disparity agrees to `tolerance`.
// If none agrees, the tap is the pixel with the closest disparity.
SurfaceTaps TapsAt(const DisparityMap& map, double tolerance, double x, double y, float disparity);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_SURFACE_TAPS_H_
