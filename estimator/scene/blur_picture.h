#ifndef THICKLENS_ESTIMATOR_SCENE_BLUR_PICTURE_H_
#define THICKLENS_ESTIMATOR_SCENE_BLUR_PICTURE_H_

#include <optional>

#include "estimator/projection/scene_projection.h"
#include "thicklens/estimator/estimate_input.h"

namespace thicklens::estimator {

// A photograph as its blur is looked at: without fall-off, with the disparity of its pixels, at
// half its size unless it is small, and again where it is large.
struct BlurPicture {
  model::LinearPicture picture;
  DisparityMap disparity;
  int halvings = 0;
};
BlurPicture BlurPictureOf(const EstimateInput& input, bool falloff, int threads);

// H of as many rows in the middle as the whole process may hold beside what solves for them; the
// picture keeps these. Throws Error if they are but a few.
SceneProjection<float> ProjectionWithin(const Eigen::ArrayXXd& weights,
                                        std::optional<double> memory_limit_mib,
                                        const ProjectionOptions& options, BlurPicture* picture);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SCENE_BLUR_PICTURE_H_
