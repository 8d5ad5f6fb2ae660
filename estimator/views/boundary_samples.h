#ifndef THICKLENS_ESTIMATOR_VIEWS_BOUNDARY_SAMPLES_H_
#define THICKLENS_ESTIMATOR_VIEWS_BOUNDARY_SAMPLES_H_

#include <vector>

#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {

// Returns, by index, the samples of a view whose pixels two surfaces share, as RenderDisparity
// specifies them. `at_jump`: the indices of the map's pixels at a jump of the disparity.
std::vector<kernels::BoundarySample> FindBoundarySamples(const DisparityMap& map,
                                                         const std::vector<int>& at_jump,
                                                         const CompactView& view);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_BOUNDARY_SAMPLES_H_
