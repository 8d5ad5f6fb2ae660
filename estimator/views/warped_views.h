#ifndef THICKLENS_ESTIMATOR_VIEWS_WARPED_VIEWS_H_
#define THICKLENS_ESTIMATOR_VIEWS_WARPED_VIEWS_H_

#include <vector>

#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

// Returns the image warped to every view. `disparity` receives the disparity of each view's samples
// (view l * U + k) that the warp used; it may be null.
model::LightField WarpToAllViews(const EstimateInput& input, bool falloff, int threads,
                                 std::vector<std::vector<float>>* disparity);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_WARPED_VIEWS_H_
