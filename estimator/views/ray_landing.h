#ifndef THICKLENS_ESTIMATOR_VIEWS_RAY_LANDING_H_
#define THICKLENS_ESTIMATOR_VIEWS_RAY_LANDING_H_

#include <Eigen/Core>

#include "thicklens/kernels/kernels.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {

// [D19] q = Q du/p per axis: px that a ray lands beside its sample, per view step. 0 where ST lies
// in the plane of focus, also where rounding has left a trace of Q.
Eigen::Vector2d LandingStepPx(const model::Camera& camera, const model::LightFieldGrid& grid);

// The rays of a rectangle of pixels in plain numbers; `weights` (V x U) may be others than the
// light field's own. Values are not looked at.
kernels::BlockGeometry BlockOf(const model::LightField& light_field, const model::PixelRect& rect,
                               const Eigen::ArrayXXd& weights);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_RAY_LANDING_H_
