#ifndef THICKLENS_ESTIMATOR_SCENE_COARSE_START_H_
#define THICKLENS_ESTIMATOR_SCENE_COARSE_START_H_

#include "thicklens/estimator/disparity_map.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// At half its size, an image is blurred by half as many pixels and costs a quarter. The sharp scene
// that it shows is the start of the iteration at full size.

// Averages each four pixels; a last row or column without a partner is used twice.
model::LinearImage HalfSize(const model::LinearImage& image);
// Halves a map like the image. The disparity is that of the first of the four pixels, so that it
// stays on one surface; the step is halved.
DisparityMap HalfSize(const DisparityMap& map);

// Returns `image` plus the difference of `sharp` and `blurred`, both of half its size,
// interpolated cubically.
model::LinearImage WithDetail(const model::LinearImage& image, const model::LinearImage& blurred,
                              const model::LinearImage& sharp);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_COARSE_START_H_
