#ifndef THICKLENS_TOOLS_OPTIONS_ESTIMATE_INPUT_H_
#define THICKLENS_TOOLS_OPTIONS_ESTIMATE_INPUT_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "thicklens/estimator/aperture_blur.h"
#include "thicklens/estimator/estimate_input.h"
#include "tools/options/estimate_aperture.h"
#include "tools/options/estimate_options.h"
#include "tools/options/light_field_options.h"

namespace thicklens::tools {

struct PreparedEstimate {
  estimator::EstimateInput input;
  model::EffectSelection effects;
  PreparedDepth depth;  // without its disparity, which is in `input`
  // Noise of the disparity, px per view step: as read, and after smoothing if it was smoothed.
  std::optional<double> depth_noise_px, depth_noise_left_px;
  EstimateAperture aperture;
  std::optional<estimator::ApertureBlur> aperture_blur;  // with a camera
  // Agreement of the photograph's EXIF with the camera file; null if there is no EXIF or no camera.
  nlohmann::json exif;
};

// Minimum and maximum disparity, px per view step along u, or along v if there is one view in u.
std::pair<double, double> DisparityRangePx(const estimator::DisparityMap& map);

// Reads photograph, depth and camera and reports what is assumed about them. Throws Error and
// UsageError.
PreparedEstimate PrepareEstimate(const EstimateOptions& options);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_ESTIMATE_INPUT_H_
