#ifndef THICKLENS_ESTIMATOR_SCENE_COARSE_START_H_
#define THICKLENS_ESTIMATOR_SCENE_COARSE_START_H_

#include "thicklens/estimator/view_geometry.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// A picture at half its size is blurred by half as many pixels and costs a quarter: what it shows
// of the sharp scene is where the iteration at full size starts.

// Each pixel the mean of four; a last row or column without a partner stands for both.
model::LinearPicture HalfSize(const model::LinearPicture& picture);
// The same pixels: the first of the four, whose surface it stays on; half the step.
DisparityMap HalfSize(const DisparityMap& map);

// `picture` with what `sharp` has more than `blurred`, both of half its size, cubic between their
// pixels.
model::LinearPicture WithDetail(const model::LinearPicture& picture,
                                const model::LinearPicture& blurred,
                                const model::LinearPicture& sharp);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_COARSE_START_H_
