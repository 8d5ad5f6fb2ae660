#ifndef THICKLENS_ESTIMATOR_ESTIMATE_INPUT_H_
#define THICKLENS_ESTIMATOR_ESTIMATE_INPUT_H_

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/disparity_map.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/transfer_curve.h"

namespace thicklens::estimator {

// The data that an estimate starts from. Valid inputs satisfy CheckInput (input_checks.h).
struct EstimateInput {
  model::LinearImage image;  // photograph, linear light
  // One per value of the image: 1 where it is clipped, so that it is only a lower bound of the
  // light [D181], and 0 elsewhere. Empty: none is clipped.
  std::vector<std::uint8_t> clipped = {};
  DisparityMap disparity;   // without holes, of the image's size
  Eigen::ArrayXXd weights;  // V x U, sum 1, >= 0
  // The curve of the photograph's encoded values.
  model::TransferCurve transfer = model::TransferCurve::Srgb();
  // Either both are set or neither is. The S x T samples of the grid are the size of the image.
  std::optional<model::LightFieldGrid> grid;
  std::optional<model::Camera> camera;          // calibrated
  std::optional<model::Camera> falloff_camera;  // camera of the fall-off if it differs from
                                                // `camera`, for example a thin lens

  // The camera of the fall-off; one of the two must be present.
  const model::Camera& camera_of_falloff() const {
    return falloff_camera ? *falloff_camera : *camera;
  }
};

// Returns the radiance of a photograph: each pixel is divided by the value that the irradiance
// fall-off of [S12] leaves of a uniform radiance 1 at that pixel (FalloffOfImage). Throws Error
// if the weights (V x U) do not fit the grid.
THICKLENS_EXPORT model::LinearImage WithoutFalloff(const model::LinearImage& photograph,
                                                   const model::LightFieldGrid& grid,
                                                   const model::Camera& camera,
                                                   const Eigen::ArrayXXd& weights, int threads);

// Returns the image warped to every view: the prior of the estimate and the baseline DIBR.
// `falloff`: the fall-off is divided out of the image first if the input has a camera.
THICKLENS_EXPORT model::LightField WarpedLightField(const EstimateInput& input, bool falloff,
                                                    int threads);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_ESTIMATE_INPUT_H_
