#ifndef THICKLENS_ESTIMATOR_ESTIMATE_INPUT_H_
#define THICKLENS_ESTIMATOR_ESTIMATE_INPUT_H_

#include <Eigen/Core>
#include <optional>

#include "thicklens/estimator/view_geometry.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::estimator {

// What the estimate starts from.
struct EstimateInput {
  model::LinearPicture picture;
  DisparityMap disparity;   // without holes, of the picture's size
  Eigen::ArrayXXd weights;  // V x U, sum 1, >= 0
  model::TransferCurve transfer = model::TransferCurve::Srgb();
  // Both or none. S x T of the grid is the size of the picture.
  std::optional<model::LightFieldGrid> grid;
  std::optional<model::Camera> camera;
  std::optional<model::Camera>
      falloff_camera;  // of the fall-off, if it is another, for example thin

  const model::Camera& camera_of_falloff() const {
    return falloff_camera ? *falloff_camera : *camera;
  }
};

// A photograph as radiance: divided by what the irradiance fall-off of [S12] leaves of a uniform
// radiance at each of its pixels.
model::LinearPicture WithoutFalloff(const model::LinearPicture& photograph,
                                    const model::LightFieldGrid& grid, const model::Camera& camera,
                                    const Eigen::ArrayXXd& weights, int threads);

// The picture warped to every view: the prior of the estimate, and the baseline DIBR.
model::LightField WarpedLightField(const EstimateInput& input, bool falloff, int threads);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_ESTIMATE_INPUT_H_
