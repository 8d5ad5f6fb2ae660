#include "tools/interface/depth_causes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

namespace thicklens {
namespace {

struct ValueRange {
  double least = std::numeric_limits<double>::infinity();
  double most = -std::numeric_limits<double>::infinity();
  std::size_t negative = 0, positive = 0, zero = 0;
};

// The range of the values that are numbers and no stated holes.
ValueRange RangeOf(const DepthMap& map) {
  ValueRange range;
  for (const float value : map.values) {
    const bool is_hole =
        !std::isfinite(value) ||
        std::any_of(map.holes.hole_values.begin(), map.holes.hole_values.end(),
                    [value](double hole) { return static_cast<float>(hole) == value; });
    if (is_hole) continue;
    range.least = std::min<double>(range.least, value);
    range.most = std::max<double>(range.most, value);
    range.negative += value < 0 ? 1 : 0;
    range.positive += value > 0 ? 1 : 0;
    range.zero += value == 0 ? 1 : 0;
  }
  return range;
}

// The usual full scale up to which a number goes: 1, 255 or 65535; otherwise the number.
double FullScaleAbove(double most) {
  for (const double full_scale : {1.0, 255.0, 65535.0}) {
    if (most <= full_scale) return full_scale;
  }
  return most;
}

// The full scale that the values of a relative map span; none if they do not.
std::optional<double> SpannedScale(const ValueRange& range) {
  constexpr double kNearlyAll = 0.9, kNearlyNone = 0.1;
  const double full_scale = FullScaleAbove(range.most);
  const bool spans = range.least >= 0 && full_scale <= 65535 &&
                     range.most >= kNearlyAll * full_scale &&
                     range.least <= kNearlyNone * full_scale;
  return spans ? std::optional(full_scale) : std::nullopt;
}

bool HasLengths(const DepthMap& map) {
  return map.meaning.kind == DepthKind::kZ || map.meaning.kind == DepthKind::kRange;
}

}  // namespace

std::string ValuesBeyondNear(const DepthMap& map, const RunScope& run) {
  if (map.meaning.kind != DepthKind::kInverse || !map.near_value) return "";
  constexpr double kRounding = 1.001;
  const double most = RangeOf(map).most;
  if (!(most > kRounding * *map.near_value)) return "";
  const double full_scale = FullScaleAbove(most);
  return fmt::format(
      "its values go up to {:g}, but in a map of floats {:g} is the value of the near depth ({}): "
      "divide the values by {:g}, or, if {:g} is near, state {} {:.6g} and {} {:.6g} instead",
      most, *map.near_value, run.Option("depth.near_mm"), full_scale, full_scale,
      run.Option("depth.meaning.inverse_scale_dpt"),
      map.meaning.inverse_scale_dpt * *map.near_value / full_scale,
      run.Option("depth.meaning.inverse_offset_dpt"), map.meaning.inverse_offset_dpt);
}

std::string CauseInMap(const DepthMap& map, const RunScope& run) {
  const std::string beyond = ValuesBeyondNear(map, run);
  if (!beyond.empty()) return beyond;
  if (!HasLengths(map)) return "";
  const ValueRange range = RangeOf(map);
  if (range.negative > range.positive) {
    return fmt::format(
        "{} of its values are negative and {} positive, as in a map whose axis points at the "
        "viewer "
        "(OpenGL): multiply the values by -1, in Python numpy.save('depth.npy', -depth)",
        range.negative, range.positive);
  }
  constexpr double kSmallLevels = 16;
  if (map.is_lossy && range.zero > 0) {
    const auto small = std::count_if(map.values.begin(), map.values.end(), [](float value) {
      return value > 0 && value <= kSmallLevels;
    });
    if (small > 0) {
      return fmt::format(
          "the file is compressed with losses, which makes small values of the zeros around holes "
          "({} pixels have 1 to {:g}): store the map as PNG, TIFF or PFM",
          small, kSmallLevels);
    }
  }
  const std::optional<double> full_scale = SpannedScale(range);
  if (full_scale) {
    return fmt::format(
        "the values from {:.4g} to {:.4g} span 0 to {:g}, as those of a relative map do, which has "
        "no unit: {} inverse with {} and {} reads one of inverse depth (MiDaS, DPT, Depth "
        "Anything)",
        range.least, range.most, *full_scale, run.Option("depth.meaning.kind"),
        run.Option("depth.near_mm"), run.Option("depth.far_mm"));
  }
  return "";
}

}  // namespace thicklens
