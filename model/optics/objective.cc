#include "thicklens/model/objective.h"

#include <fmt/format.h>

#include <cmath>

#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"

namespace thicklens::model {

bool Objective::IsValid(std::string* why) const {
  if (!(magnification > 0 && std::isfinite(magnification)))
    return Fail(why, fmt::format("magnification is {}: it must be > 0", magnification));
  if (!(numerical_aperture > 0 && numerical_aperture < 1)) {
    return Fail(why, fmt::format("numerical_aperture is {}: it must be between 0 and 1, as it is "
                                 "in air (immersion is not supported)",
                                 numerical_aperture));
  }
  if (!(tube_lens_focal_length_mm > 0 && std::isfinite(tube_lens_focal_length_mm))) {
    return Fail(why, fmt::format("tube_lens_focal_length_mm is {}: it must be > 0",
                                 tube_lens_focal_length_mm));
  }
  return true;
}

ThickLens LensOfObjective(const Objective& objective) {
  std::string why;
  if (!objective.IsValid(&why)) throw Error("objective: " + why);
  const double f_mm = objective.tube_lens_focal_length_mm / objective.magnification;
  const double zf_mm = f_mm * (1 + 1 / objective.magnification);
  const double na = objective.numerical_aperture;
  return {f_mm, f_mm, 0, zf_mm * na / std::sqrt(1 - na * na)};
}

}  // namespace thicklens::model
