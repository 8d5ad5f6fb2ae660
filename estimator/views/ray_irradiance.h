#ifndef THICKLENS_ESTIMATOR_VIEWS_RAY_IRRADIANCE_H_
#define THICKLENS_ESTIMATOR_VIEWS_RAY_IRRADIANCE_H_

#include <Eigen/Core>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {

// Throws Error if the weights differ in size from the grid's views (V x U), if one is below 0, or
// if their sum is not positive.
void CheckViewWeights(const model::LightFieldGrid& grid, const Eigen::ArrayXXd& weights);

// Returns the relative irradiance [D29], dimensionless, of every ray of the view (k, l), T x S row
// by row: cos(alpha) cos^3(beta) of [S12], divided by its value for the view's ray that lands at
// the principal point. The calibrated blur is that of a point on the axis with its fall-off, and
// the weights of the views contain it; so [S12] adds only the change from there. A uniform radiance
// 1 gives 1 at the principal point. Throws Error if the weights differ in size from the grid's
// views (V x U), if one is below 0, or if their sum is not positive.
std::vector<float> RelativeFalloff(const model::LightFieldGrid& grid, const model::Camera& camera,
                                   const Eigen::ArrayXXd& weights, int k, int l);

// Returns the image of a uniform radiance 1: for each pixel the mean of RelativeFalloff, by
// `weights`, over the rays that land nearest to the pixel, one per view. A ray that is not a sample
// of the grid is left out; where none is a sample, all rays are used as if they were samples.
std::vector<float> FalloffOfImage(const model::LightFieldGrid& grid, const model::Camera& camera,
                                  const Eigen::ArrayXXd& weights, int width_px, int height_px,
                                  int threads = 1);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_RAY_IRRADIANCE_H_
