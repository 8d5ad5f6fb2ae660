#ifndef THICKLENS_ESTIMATOR_VIEWS_SURFACE_TAPS_H_
#define THICKLENS_ESTIMATOR_VIEWS_SURFACE_TAPS_H_

#include <array>
#include <cstddef>

#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {

// Pixels whose disparities differ by more are not of one surface, in the unit of the map (.3 px per
// view step); infinite where the steps are 0.
double SurfaceTolerance(const DisparityMap& map);

// The picture between its pixels on one surface: up to four pixels and their weights, sum 1.
struct SurfaceTaps {
  int count = 0;
  std::array<std::size_t, 4> pixel{};
  std::array<double, 4> weight{};
};
// Bilinear at (x, y), cut to the picture, of the pixels whose disparity agrees; where none does,
// the one closest to it.
SurfaceTaps TapsAt(const DisparityMap& map, double tolerance, double x, double y, float disparity);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_SURFACE_TAPS_H_
