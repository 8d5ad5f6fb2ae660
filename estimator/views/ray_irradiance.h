#ifndef THICKLENS_ESTIMATOR_VIEWS_RAY_IRRADIANCE_H_
#define THICKLENS_ESTIMATOR_VIEWS_RAY_IRRADIANCE_H_

#include <Eigen/Core>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {

// Throws Error for weights of another size than the grid's views (V x U), below 0 or without a
// positive sum.
void CheckViewWeights(const model::LightFieldGrid& grid, const Eigen::ArrayXXd& weights);

// Relative irradiance [D29], dimensionless, of every ray of the view (k, l), T x S row by row:
// cos(alpha) cos^3(beta) of [S12] over the same of the view's ray that lands at the principal
// point. The calibrated blur is that of a point on the axis with its fall-off, and the weights of
// the views carry it; so [S12] adds only what changes from there. A uniform radiance 1 gives 1 at
// the principal point. Throws Error for weights of another size than the grid's views (V x U), or
// without a positive sum.
std::vector<float> RelativeFalloff(const model::LightFieldGrid& grid, const model::Camera& camera,
                                   const Eigen::ArrayXXd& weights, int k, int l);

// What a uniform radiance 1 gives at each pixel of the picture: the mean of the above, by
// `weights`, over the rays that land nearest to the pixel, one a view. Where a ray is no sample of
// the grid, the others; where none is, all of them, as if they were.
std::vector<float> FalloffOfPicture(const model::LightFieldGrid& grid, const model::Camera& camera,
                                    const Eigen::ArrayXXd& weights, int width_px, int height_px,
                                    int threads = 1);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_RAY_IRRADIANCE_H_
