#include "tools/report/distortion_words.h"

#include <fmt/format.h>

#include "thicklens/base/printable_text.h"

namespace thicklens::tools {

std::string DistortionWords(const model::LensDistortion& distortion) {
  return fmt::format(
      "{}{}, up to {:.3g} px", distortion.Description(),
      distortion.source.empty() ? "" : fmt::format(" ({})", PrintableUtf8(distortion.source)),
      distortion.LargestShiftPx());
}

nlohmann::json DistortionJson(const std::optional<model::LensDistortion>& distortion) {
  if (!distortion) return nullptr;
  const model::LensDistortion& d = *distortion;
  return {{"model", model::DistortionModelName(d.model)},
          {"size_px", {d.width_px, d.height_px}},
          {"focal_length_px", {d.focal_length_px.x(), d.focal_length_px.y()}},
          {"principal_point_px", {d.principal_point_px.x(), d.principal_point_px.y()}},
          {"coefficients", d.coefficients},
          {"source", PrintableUtf8(d.source)},
          {"largest_shift_px", d.LargestShiftPx()}};
}

}  // namespace thicklens::tools
