#ifndef THICKLENS_TOOLS_INTERFACE_DEPTH_PLAUSIBILITY_H_
#define THICKLENS_TOOLS_INTERFACE_DEPTH_PLAUSIBILITY_H_

#include <Eigen/Core>
#include <optional>

#include "thicklens/camera.h"
#include "thicklens/depth.h"
#include "thicklens/estimator/disparity_map.h"
#include "thicklens/model/scene.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

// Reports the range of a map before anything is computed: least, median and largest depth and
// disparity, the displacement between neighbouring views and the blur that they mean. Warns of
// views that differ by less than 0.3 px over the whole aperture, with the aperture that would show
// 1 px. `is_focus_on_grid`: the plane of focus has the disparity 0, so that it says the blur.
// Throws Error, with the options that remedy it, for disparities that mean nothing: grey levels
// taken as px, and views of which half see a point a large part of an image apart.
void ReportPlausibility(const DepthMap& map, const estimator::DisparityMap& disparity,
                        const Eigen::ArrayXXd& weights, bool is_focus_on_grid,
                        const std::optional<Camera>& camera,
                        const std::optional<model::DepthStatistics>& depth, RunScope* run);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_DEPTH_PLAUSIBILITY_H_
