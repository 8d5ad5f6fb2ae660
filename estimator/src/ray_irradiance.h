#ifndef THICKLENS_ESTIMATOR_SRC_RAY_IRRADIANCE_H_
#define THICKLENS_ESTIMATOR_SRC_RAY_IRRADIANCE_H_

#include <Eigen/Core>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {

// Relative irradiance, dimensionless, of every ray of the view (k, l), T x S row by row:
// cos(alpha) cos^3(beta) of (12) over the mean of the same, by `weights` (V x U, >= 0, any sum), of
// the rays that land at the principal point. So a uniform radiance 1 gives 1 there. Throws Error
// for weights of another size than the grid's views, or without a positive sum.
std::vector<float> RelativeFalloff(const model::LightFieldGrid& grid, const model::Camera& camera,
                                   const Eigen::ArrayXXd& weights, int k, int l);

// What a uniform radiance 1 gives at each pixel of the picture: the mean of the above, by
// `weights`, over the rays that land nearest to the pixel, one a view. Where a ray is no sample of
// the grid, the others; where none is, all of them, as if they were.
std::vector<float> FalloffOfPicture(const model::LightFieldGrid& grid, const model::Camera& camera,
                                    const Eigen::ArrayXXd& weights, int width_px, int height_px,
                                    int threads = 1);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SRC_RAY_IRRADIANCE_H_
