#ifndef THICKLENS_ESTIMATOR_VIEWS_RAY_LANDING_H_
#define THICKLENS_ESTIMATOR_VIEWS_RAY_LANDING_H_

#include <Eigen/Core>

#include "thicklens/kernels/kernels.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {

// [D19] Returns q = Q du/p per axis: the distance in px, per view step, between a ray's landing
// point and its sample. It is 0 where ST is in the plane of focus, also where rounding has left a
// trace of Q.
Eigen::Vector2d LandingStepPx(const model::Camera& camera, const model::LightFieldGrid& grid);

// Returns the rays of a rectangle of pixels in plain numbers. `weights` (V x U) may differ from the
// light field's own. The values of the light field are not read.
kernels::BlockGeometry BlockOf(const model::LightField& light_field, const model::PixelRect& rect,
                               const Eigen::ArrayXXd& weights);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_RAY_LANDING_H_
