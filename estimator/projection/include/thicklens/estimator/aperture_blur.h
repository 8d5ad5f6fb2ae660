#ifndef THICKLENS_ESTIMATOR_APERTURE_BLUR_H_
#define THICKLENS_ESTIMATOR_APERTURE_BLUR_H_

#include <Eigen/Core>

#include "thicklens/model/camera.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {

// The blur that the samples of an aperture carry [D30]: the standard deviation, mm on the aperture,
// of where the rays of a point in focus cross it, about their centroid, by the weights of the views
// times the fall-off [S12] relative to the principal point.
struct ApertureBlur {
  double calibrated_sigma_mm = 0;  // kappa r
  Eigen::Vector2d sigma_mm{0, 0};  // of the point on the axis, along u and v; 0: one view
  Eigen::Vector2d corner_change{0,
                                0};  // relative change of that, at the corner where it is largest
};

// `weights`: V x U, >= 0, any positive sum. `falloff`: the camera whose irradiance rays carry;
// null: none. Throws Error for weights of another size than the grid's views, or without a positive
// sum.
ApertureBlur MeasureApertureBlur(const model::LightFieldGrid& grid, const model::Camera& camera,
                                 const Eigen::ArrayXXd& weights, const model::Camera* falloff);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_APERTURE_BLUR_H_
