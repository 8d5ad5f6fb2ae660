#ifndef THICKLENS_ESTIMATOR_VIEWS_WARPED_VIEWS_H_
#define THICKLENS_ESTIMATOR_VIEWS_WARPED_VIEWS_H_

#include <vector>

#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

// The picture warped to every view, with the disparity of each view's samples (l * U + k) that the
// warp went by; `disparity` may be null.
model::LightField WarpToAllViews(const EstimateInput& input, bool falloff, int threads,
                                 std::vector<std::vector<float>>* disparity);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_WARPED_VIEWS_H_
