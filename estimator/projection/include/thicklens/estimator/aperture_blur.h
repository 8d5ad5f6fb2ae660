#ifndef THICKLENS_ESTIMATOR_APERTURE_BLUR_H_
#define THICKLENS_ESTIMATOR_APERTURE_BLUR_H_

#include <Eigen/Core>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {

// The blur that the samples of an aperture contain [D30]: the standard deviation, in mm on the
// aperture, of the positions where the rays of a point in focus cross it, about their centroid. The
// rays are weighted by the weights of the views times the fall-off [S12] relative to the principal
// point.
struct ApertureBlur {
  double calibrated_sigma_mm = 0;  // kappa r
  Eigen::Vector2d sigma_mm{
      0, 0};  // sigma of the point on the axis, along u and v; 0 for a single view
  Eigen::Vector2d corner_change{0, 0};  // largest relative change of sigma_mm over the corners
};

// Measures the blur of an aperture. `weights`: V x U, >= 0, any positive sum. `falloff`: the camera
// whose irradiance the rays have; null: none. Throws Error if the weights differ in size from the
// grid's views, if one is below 0, or if their sum is not positive.
THICKLENS_EXPORT ApertureBlur MeasureApertureBlur(const model::LightFieldGrid& grid,
                                                  const model::Camera& camera,
                                                  const Eigen::ArrayXXd& weights,
                                                  const model::Camera* falloff);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_APERTURE_BLUR_H_
