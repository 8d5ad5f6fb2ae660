// The image distance of a camera whose lens or sensor moves.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"
#include "thicklens/model/camera.h"

namespace thicklens::model {

double FocusPositions::ImageDistanceMm(double reading) const {
  std::string why;
  if (!IsValid(&why)) throw Error("focus_positions: " + why);
  const Position& first = positions.front();
  const Position& last = positions.back();
  if (!(reading >= first.reading && reading <= last.reading)) {
    throw Error(fmt::format(
        "the position of the lens is {} {}: the calibration has positions from {} to {} {}",
        reading, unit, first.reading, last.reading, unit));
  }
  const auto above = std::find_if(positions.begin() + 1, positions.end(),
                                  [&](const Position& p) { return p.reading >= reading; });
  const Position& below = *(above - 1);
  const double part = (reading - below.reading) / (above->reading - below.reading);
  return below.image_distance_mm + part * (above->image_distance_mm - below.image_distance_mm);
}

bool FocusPositions::IsValid(std::string* why) const {
  if (unit != "mm" && unit != kDioptreUnit && unit != "steps")
    return Fail(why, fmt::format("unit is '{}': it must be mm, steps or {}", unit, kDioptreUnit));
  if (positions.size() < 2)
    return Fail(why,
                fmt::format("there are {} positions: at least 2 are needed", positions.size()));
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Position& p = positions[i];
    if (!std::isfinite(p.reading) || !(p.image_distance_mm > 0) ||
        !std::isfinite(p.image_distance_mm)) {
      return Fail(why,
                  fmt::format("position {}: reading {} and image_distance_mm {} must be finite, "
                              "and the distance > 0",
                              i, p.reading, p.image_distance_mm));
    }
    if (i > 0 && !(p.reading > positions[i - 1].reading)) {
      return Fail(why, fmt::format("position {}: the readings must rise, but {} follows {}", i,
                                   p.reading, positions[i - 1].reading));
    }
  }
  return true;
}

}  // namespace thicklens::model
