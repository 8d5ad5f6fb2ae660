#ifndef THICKLENS_ESTIMATOR_SCENE_BLUR_IMAGE_H_
#define THICKLENS_ESTIMATOR_SCENE_BLUR_IMAGE_H_

#include <optional>

#include "estimator/projection/scene_projection.h"
#include "estimator/scene/lower_bounds.h"
#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

// The image on which the blur is checked: a photograph without fall-off, with the disparity of its
// pixels, at half its size unless it is small, and halved again where it is large.
struct BlurImage {
  model::LinearImage image;
  DisparityMap disparity;
  int halvings = 0;
  ClippedValues clipped = {};
};
BlurImage BlurImageOf(const EstimateInput& input, bool falloff, int threads);

// Returns H of as many rows in the middle as the memory limit of the whole process permits beside
// the solver's memory; `image` is cut to these rows. Throws Error if there are too few.
SceneProjection<float> ProjectionWithin(const Eigen::ArrayXXd& weights,
                                        std::optional<double> memory_limit_mib,
                                        const ProjectionOptions& options, BlurImage* image);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_BLUR_IMAGE_H_
