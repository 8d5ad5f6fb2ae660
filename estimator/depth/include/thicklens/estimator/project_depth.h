#ifndef THICKLENS_ESTIMATOR_PROJECT_DEPTH_H_
#define THICKLENS_ESTIMATOR_PROJECT_DEPTH_H_

#include <Eigen/Core>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/resample_depth.h"

namespace thicklens::estimator {

// The samples of a depth map as another camera sees them.
struct SeenSamples {
  std::vector<Eigen::Vector2d> positions;  // on the other camera's grid, px; NaN: not seen
  std::vector<float> values;               // inverse depth along the other camera's axis, > 0
};

// Renders the samples of a map on the grid of another camera, of width_px x height_px samples
// [D189]. Each square of four samples becomes two triangles, as far as their corners are of one
// surface; in a triangle the inverse depth is linear in the position, which is exact for a plane. A
// sample without a triangle covers the nearest sample of the grid. Of several surfaces the nearest
// counts, so that it hides what lies behind it. Samples of the grid that nothing covers are NaN:
// the depth camera did not see that place. The confidence, if there is one, is interpolated alike.
// `map.values` must be linear in 1/z. Throws Error if the sizes do not fit.
THICKLENS_EXPORT DepthSampling ProjectDepth(const DepthSampling& map, const SeenSamples& seen,
                                            int width_px, int height_px);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_PROJECT_DEPTH_H_
