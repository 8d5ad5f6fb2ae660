#ifndef THICKLENS_TOOLS_ESTIMATE_APERTURE_H_
#define THICKLENS_TOOLS_ESTIMATE_APERTURE_H_

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "estimate_options.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::tools {

// How the photograph's aperture weighs the views of an estimate, and who says so.
struct EstimateAperture {
  Eigen::ArrayXXd weights;  // V x U, sum 1; 0 where there is no view
  std::string shape;        // "uniform", "gaussian", "disc" or "weights of no known shape"
  // "option" (--aperture-shape), "light-field" (the file of --aperture-of), "camera" (its psf) or
  // "assumed" (nobody says it).
  std::string from;
  std::string views_of;  // --aperture-of; empty: all views of a rectangle
  // Views of --aperture-of are so far apart on the aperture, where its file says it, mm.
  std::optional<Eigen::Vector2d> step_mm;

  std::string InWords() const;
  nlohmann::json Json() const;
};

// Positions are those of --aperture-of if it is given, else of --views. Weights are those of
// --aperture-shape, else those that the file of --aperture-of states, else those of the camera's
// psf, else equal, which is told. Throws Error where the file of --aperture-of states other weights
// than those of --aperture-shape. `camera` may be null.
EstimateAperture ApertureFor(const EstimateOptions& options, const model::Camera* camera);

// Warns where the views of the estimate stand elsewhere on the aperture than those of
// --aperture-of, because camera and weights ask for other steps.
void WarnOfOtherSteps(const EstimateOptions& options, const EstimateAperture& aperture,
                      const model::LightFieldGrid& grid, const model::Camera& camera);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_ESTIMATE_APERTURE_H_
