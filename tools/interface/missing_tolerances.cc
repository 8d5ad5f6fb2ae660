#include "tools/interface/missing_tolerances.h"

#include <fmt/format.h>

#include <vector>

namespace thicklens {

std::string MissingTolerancesLine(const Camera& camera) {
  const auto is_missing = [&](const std::string& field) {
    const auto statement = camera.statements.find(field);
    return statement == camera.statements.end() || !(statement->second.tolerance > 0);
  };
  // The focal length of an objective follows from its data: its magnification has an error without
  // a statement, too.
  const bool focal_length = !camera.objective && (is_missing("lens.front_focal_length_mm") ||
                                                  is_missing("lens.rear_focal_length_mm"));
  const bool pitch = is_missing("sensor.pixel_pitch_mm");
  if (!focal_length && !pitch) return "";
  std::string effect;
  if (focal_length) effect = "d1 moves about 1 % for each 1 % of the focal length";
  if (pitch)
    effect += focal_length ? ", kappa about 1 % for each 1 % of the pixel pitch"
                           : "kappa moves about 1 % for each 1 % of the pixel pitch";
  return fmt::format(
      "no tolerance is stated for the {}: the intervals take {} as exact, but {}; give {{value: "
      ".., tolerance: ..}} in the camera file, or ignore this for a first try",
      focal_length && pitch ? "focal lengths and the pixel pitch"
      : focal_length        ? "focal lengths"
                            : "pixel pitch",
      focal_length ? "them" : "it", effect);
}

std::string ObjectiveLine(const Camera& camera, bool magnification_is_measured) {
  if (!camera.objective) return "";
  std::string line =
      "the lens is stated by the data of an objective: zf, d1 and the bench offset are those of "
      "its equivalent thin lens, not lengths that can be measured on the microscope";
  const auto stated = camera.statements.find("lens.magnification");
  if (magnification_is_measured ||
      (stated != camera.statements.end() && stated->second.tolerance > 0))
    return line;
  return line +
         "; no tolerance of lens.magnification is stated, and the intervals take the 5 % that ISO "
         "8039 allows: kappa moves about 1 % for each 1 % of it; state magnification more "
         "precisely: give {value: .., tolerance: ..} in the camera file, or target_period_mm with "
         "a stage micrometer in view";
}

}  // namespace thicklens
