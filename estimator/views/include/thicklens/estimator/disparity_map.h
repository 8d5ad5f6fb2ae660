#ifndef THICKLENS_ESTIMATOR_DISPARITY_MAP_H_
#define THICKLENS_ESTIMATOR_DISPARITY_MAP_H_

#include <Eigen/Core>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// The depth of an image in the only form that the rays of its light field need: the displacement of
// each scene point between views.
struct DisparityMap {
  int width_px = 0;   // width, px
  int height_px = 0;  // height, px
  // One number per pixel, row by row; nearer points have larger values. The scene point at sample x
  // of the centre view is at x - disparity * (a step.x, b step.y) in the view (a, b). NaN marks a
  // hole.
  std::vector<float> disparity;
  // Step per view in u and v. It is (1, 1) where the disparity is in px per view step, and the
  // steps of the grid in mm where the disparity is in px per mm.
  Eigen::Vector2d step{1, 1};
};

// Converts depths (mm) to the disparity of the samples of a grid [D16]: disparity * step = -m, with
// m of model::SlopeOnGrid. A depth of NaN becomes a hole. Throws Error unless every other depth is
// beyond the UV plane (where nearer points have a larger disparity).
THICKLENS_EXPORT DisparityMap DisparityOnGrid(const model::LightFieldGrid& grid,
                                              const std::vector<float>& depth_mm, int width_px,
                                              int height_px);
// Converts a map to px per view step: scale * value + offset. NaN and infinities are holes, and so
// is 0 in an integer map. Throws Error if all values are holes, if the scale is 0, or if the scale
// or the offset is not finite.
THICKLENS_EXPORT DisparityMap DisparityFromMap(const model::RawDepthMap& map, double scale,
                                               double offset_px);

// Returns the disparity on that grid of an infinitely far point, in the unit of DisparityOnGrid.
THICKLENS_EXPORT double DisparityAtInfinity(const model::LightFieldGrid& grid);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_DISPARITY_MAP_H_
