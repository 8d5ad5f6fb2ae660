#ifndef THICKLENS_TOOLS_REPORT_DISTORTION_WORDS_H_
#define THICKLENS_TOOLS_REPORT_DISTORTION_WORDS_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "thicklens/model/lens_distortion.h"

namespace thicklens::tools {

// "OpenCV model with 5 coefficients for 4000 x 3000 px (calib.yml), up to 35.2 px".
std::string DistortionWords(const model::LensDistortion& distortion);
// Model, size, coefficients and the largest displacement; null: there is none.
nlohmann::json DistortionJson(const std::optional<model::LensDistortion>& distortion);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_DISTORTION_WORDS_H_
