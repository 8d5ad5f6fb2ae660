#ifndef THICKLENS_TOOLS_INTERFACE_PREPARE_APERTURE_H_
#define THICKLENS_TOOLS_INTERFACE_PREPARE_APERTURE_H_

#include <Eigen/Core>
#include <optional>
#include <string>

#include "thicklens/estimate.h"
#include "thicklens/model/light_field_grid.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

// The weights that the photograph's aperture gives the views of an estimate, and their origin.
struct PreparedAperture {
  Eigen::ArrayXXd weights;  // V x U, sum 1; 0 for absent views
  // "uniform", "gaussian", "disc", "measured" or "weights of no known shape"
  std::string shape;
  std::string from;  // "option", "light-field", "camera" or "assumed"
  // Distance of the views of `views_of` on the aperture, mm, if it has a camera.
  std::optional<Eigen::Vector2d> step_mm;
  // The samples of the camera's measured PSF, if the weights are its own.
  std::optional<model::ApertureSamples> measured;
};
// The weights are, in this order, those of options.aperture.shape, those that views_of states,
// those of the camera's psf (measured or of a shape), or equal ones. Throws Error if views_of
// states other weights than the shape. `camera` may be null.
PreparedAperture PrepareAperture(const EstimateOptions& options, const Camera* camera,
                                 RunScope* run);

// Warns if the views of the estimate have other positions on the aperture than those of views_of.
void WarnOfOtherSteps(const EstimateOptions& options, const PreparedAperture& aperture,
                      const model::LightFieldGrid& grid, const Camera& camera, RunScope* run);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_PREPARE_APERTURE_H_
