#ifndef THICKLENS_TOOLS_OPTIONS_ESTIMATE_APERTURE_H_
#define THICKLENS_TOOLS_OPTIONS_ESTIMATE_APERTURE_H_

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "thicklens/model/camera.h"
#include "thicklens/model/light_field_grid.h"
#include "tools/options/estimate_options.h"

namespace thicklens::tools {

// The weights that the photograph's aperture gives the views of an estimate, and their origin.
struct EstimateAperture {
  Eigen::ArrayXXd weights;  // V x U, sum 1; 0 for absent views
  std::string shape;        // "uniform", "gaussian", "disc" or "weights of no known shape"
  // "option" (--aperture-shape), "light-field" (the file of --aperture-of), "camera" (its psf) or
  // "assumed" (nothing states the shape).
  std::string from;
  std::string views_of;  // --aperture-of; empty: all views of a rectangle
  // Distance of the views of --aperture-of on the aperture, mm, if its file states it.
  std::optional<Eigen::Vector2d> step_mm;

  std::string InWords() const;
  nlohmann::json Json() const;
};

// The positions are those of --aperture-of if it is given, otherwise those of --views. The weights
// are, in this order, those of --aperture-shape, those that the file of --aperture-of states, those
// of the camera's psf, or equal ones, which is reported. Throws Error if the file of --aperture-of
// states other weights than --aperture-shape. `camera` may be null.
EstimateAperture ApertureFor(const EstimateOptions& options, const model::Camera* camera);

// Warns if the views of the estimate have other positions on the aperture than those of
// --aperture-of, because camera and weights require other steps.
void WarnOfOtherSteps(const EstimateOptions& options, const EstimateAperture& aperture,
                      const model::LightFieldGrid& grid, const model::Camera& camera);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_ESTIMATE_APERTURE_H_
