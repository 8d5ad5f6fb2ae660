#include "tools/interface/depth_causes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"

namespace thicklens {
namespace {

struct ValueRange {
  double least = std::numeric_limits<double>::infinity();
  double most = -std::numeric_limits<double>::infinity();
  std::size_t negative = 0, positive = 0;
  bool is_whole = true;  // all values are whole numbers
};

// The values of a map that are no holes and no marks, and the marks that nobody stated.
struct MapValues {
  std::vector<float> values;  // NaN: hole
  ValueRange range;           // without holes and suspects
  std::vector<model::SuspectedMark> suspects;
};

MapValues ValuesOf(const DepthMap& map) {
  model::RawDepthMap raw{map.width_px, map.height_px, map.values, map.is_integer,
                         map.largest_of_type};
  MapValues found;
  found.suspects = model::MarkHoles(map.meaning.kind, map.holes, &raw).suspects;
  for (const float value : raw.values) {
    const bool is_suspect =
        std::any_of(found.suspects.begin(), found.suspects.end(),
                    [value](const model::SuspectedMark& mark) { return mark.value == value; });
    if (std::isnan(value) || is_suspect) continue;
    ValueRange& range = found.range;
    range.least = std::min<double>(range.least, value);
    range.most = std::max<double>(range.most, value);
    range.negative += value < 0 ? 1 : 0;
    range.positive += value > 0 ? 1 : 0;
    range.is_whole = range.is_whole && value == std::floor(value);
  }
  found.values = std::move(raw.values);
  return found;
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

// ---- Signs.

struct CountedValue {
  float value = 0;
  std::size_t pixels = 0;
};

// The values below 0 that are most frequent, at most three, the most frequent one first.
std::vector<CountedValue> FrequentNegatives(const std::vector<float>& values) {
  std::vector<float> below;
  std::copy_if(values.begin(), values.end(), std::back_inserter(below),
               [](float value) { return value < 0; });
  std::sort(below.begin(), below.end());
  std::vector<CountedValue> frequent;
  constexpr std::size_t kMaxMarks = 3;
  for (auto first = below.begin(); first != below.end();) {
    const auto last = std::upper_bound(first, below.end(), *first);
    const auto pixels = static_cast<std::size_t>(last - first);
    const auto at =
        std::find_if(frequent.begin(), frequent.end(),
                     [pixels](const CountedValue& other) { return other.pixels < pixels; });
    frequent.insert(at, {*first, pixels});
    if (frequent.size() > kMaxMarks) frequent.pop_back();
    first = last;
  }
  return frequent;
}

// The numbers that are nearly all of the negative values, if they are so few that they may be marks
// of "no depth" beside depths, which spread; otherwise none.
std::vector<CountedValue> NegativeMarks(const std::vector<float>& values, std::size_t negative,
                                        std::size_t positive) {
  constexpr double kNearlyAll = 0.99, kMinPositive = 0.01;
  const auto all = static_cast<double>(negative);
  if (static_cast<double>(positive) < kMinPositive * static_cast<double>(values.size())) return {};
  std::vector<CountedValue> marks;
  std::size_t pixels = 0;
  for (const CountedValue& frequent : FrequentNegatives(values)) {
    marks.push_back(frequent);
    pixels += frequent.pixels;
    if (static_cast<double>(pixels) >= kNearlyAll * all) return marks;
  }
  return {};
}

std::string CauseInSigns(const std::vector<float>& values, const RunScope& run) {
  std::size_t negative = 0, positive = 0;
  for (const float value : values) {
    negative += value < 0 ? 1 : 0;
    positive += value > 0 ? 1 : 0;
  }
  if (negative <= positive) return "";
  const std::vector<CountedValue> marks = NegativeMarks(values, negative, positive);
  if (marks.empty()) {
    return fmt::format(
        "{} of its values are negative and {} positive, as in a map whose axis points at the "
        "viewer (OpenGL): multiply the values by -1, in Python numpy.save('depth.npy', -depth)",
        negative, positive);
  }
  std::string names, options;
  for (const CountedValue& mark : marks) {
    names += fmt::format("{}{}", names.empty() ? "" : " or ", mark.value);
    options +=
        fmt::format("{}{} {}", options.empty() ? "" : " ", run.Option("depth.holes"), mark.value);
  }
  return fmt::format(
      "{} of its values are negative and {} positive, but nearly all of the negative ones are "
      "exactly {}: if that means 'no depth', state it by {}",
      negative, positive, names, options);
}

// ---- Compression.

// Values up to which compression changes a 0: the standard's table for luminance (Annex K, that of
// quality 50) quantises the mean of a block in steps of 16, and edges of holes are off by as much.
constexpr float kSmallLevels = 16;

// The number of small values beside a 0, as compression makes them of the zeros around holes.
std::size_t SmallBesideZero(const DepthMap& map) {
  const auto width = static_cast<std::size_t>(map.width_px);
  const auto height = static_cast<std::size_t>(map.height_px);
  const auto is_zero = [&](std::size_t x, std::size_t y) { return map.values[y * width + x] == 0; };
  std::size_t count = 0;
  for (std::size_t y = 0; y < height; ++y) {
    ThrowIfCancelled();
    for (std::size_t x = 0; x < width; ++x) {
      const float value = map.values[y * width + x];
      if (!(value > 0 && value <= kSmallLevels)) continue;
      const bool is_beside = (x > 0 && is_zero(x - 1, y)) || (x + 1 < width && is_zero(x + 1, y)) ||
                             (y > 0 && is_zero(x, y - 1)) || (y + 1 < height && is_zero(x, y + 1));
      count += is_beside ? 1 : 0;
    }
  }
  return count;
}

std::string CauseInCompression(const DepthMap& map) {
  const std::size_t small = map.is_lossy ? SmallBesideZero(map) : 0;
  if (small == 0) return "";
  return fmt::format(
      "the file is compressed with losses, which makes small values of the zeros around holes ({} "
      "pixels beside a 0 have 1 to {:g}): the program that made the map must store it as PNG, TIFF "
      "or PFM, since the values in this file are changed already and converting it does not help",
      small, kSmallLevels);
}

// ---- Relative maps.

// The range with the largest value of the type, which marks holes, but is the nearest surface of a
// relative map: other values go beyond half of it, which those of a map in mm (33 m) seldom do.
ValueRange WithLargestOfType(const DepthMap& map, ValueRange range) {
  const std::optional<double> largest = map.largest_of_type;
  constexpr double kHalf = 0.5;
  if (!largest || !(range.most > kHalf * *largest)) return range;
  const auto value = static_cast<float>(*largest);
  const std::vector<double>& stated = map.holes.hole_values;
  const bool is_stated = std::any_of(stated.begin(), stated.end(), [value](double hole) {
    return static_cast<float>(hole) == value;
  });
  if (is_stated) return range;
  if (std::find(map.values.begin(), map.values.end(), value) != map.values.end())
    range.most = std::max(range.most, *largest);
  return range;
}

std::string CauseInSpan(const ValueRange& range, const RunScope& run) {
  const std::optional<double> full_scale = SpannedScale(range);
  if (!full_scale) return "";
  return fmt::format(
      "the values from {:.4g} to {:.4g} span 0 to {:g}, as those of a relative map do, which has "
      "no unit: {} inverse with {} and {} reads one of inverse depth (MiDaS, DPT, Depth Anything)",
      range.least, range.most, *full_scale, run.Option("depth.meaning.kind"),
      run.Option("depth.near_mm"), run.Option("depth.far_mm"));
}

// The marks beyond the value that lies at the near depth, if the other values are within it.
std::string SuspectsBeyondNear(const std::vector<model::SuspectedMark>& suspects, double near_value,
                               const RunScope& run) {
  std::string found;
  for (const model::SuspectedMark& mark : suspects) {
    if (mark.value >= 0 && mark.value <= near_value) continue;
    // The float is printed with as many digits as it has.
    const auto value = static_cast<float>(mark.value);
    found += fmt::format("{}{} ({} pixels; {} {})", found.empty() ? "" : ", ", value, mark.pixels,
                         run.Option("depth.holes"), value);
  }
  if (found.empty()) return "";
  return fmt::format(
      "only values that look like marks lie outside 0 to {:g}, where {:g} is the value of the near "
      "depth ({}): {}: if they mean 'no depth', state them so",
      near_value, near_value, run.Option("depth.near_mm"), found);
}

}  // namespace

std::string ValuesBeyondNear(const DepthMap& map, const RunScope& run) {
  if (map.meaning.kind != DepthKind::kInverse || !map.near_value) return "";
  constexpr double kRounding = 1e-3;
  const double near_value = *map.near_value;
  const MapValues found = ValuesOf(map);
  const ValueRange& range = found.range;
  if (!(range.most > (1 + kRounding) * near_value) && !(range.least < -kRounding * near_value))
    return SuspectsBeyondNear(found.suspects, near_value, run);
  // Whole numbers are grey levels, and so are values that span their range; others are the numbers
  // of a network, whose least and largest one are the ends of its scale.
  const double full_scale = FullScaleAbove(range.most);
  const bool is_grey = range.least >= 0 && full_scale <= 65535 &&
                       (range.is_whole || SpannedScale(range) == full_scale);
  const double at_zero = is_grey ? 0 : range.least;
  const double at_near = is_grey ? full_scale : range.most;
  if (!(at_near > at_zero)) return "";
  // The line through (at_zero, far) and (at_near, near), 1/z in dioptres.
  const double scale_dpt = map.meaning.inverse_scale_dpt * near_value / (at_near - at_zero);
  const double offset_dpt = map.meaning.inverse_offset_dpt - scale_dpt * at_zero;
  return fmt::format(
      "its values go from {:.6g} to {:.6g}, but {:g} is the value of the near depth ({}) and 0 "
      "that "
      "of the far one: {}, or, if {:.6g} is near and {:.6g} far, state {} {:.6g} and {} {:.6g} "
      "instead",
      range.least, range.most, near_value, run.Option("depth.near_mm"),
      is_grey ? fmt::format("divide the values by {:g}", full_scale / near_value)
              : fmt::format("scale the values v of the map by {}(v - {:.6g})/({:.6g} - {:.6g})",
                            near_value == 1 ? "" : fmt::format("{:g} ", near_value), at_zero,
                            at_near, at_zero),
      at_near, at_zero, run.Option("depth.meaning.inverse_scale_dpt"), scale_dpt,
      run.Option("depth.meaning.inverse_offset_dpt"), offset_dpt);
}

std::string CauseInMap(const DepthMap& map, const RunScope& run) {
  const std::string beyond = ValuesBeyondNear(map, run);
  if (!beyond.empty()) return beyond;
  if (!HasLengths(map)) return "";
  const MapValues found = ValuesOf(map);
  const std::string signs = CauseInSigns(found.values, run);
  if (!signs.empty()) return signs;
  // A ramp that was stored as JPEG has small values beside zeros too: both are named.
  const std::string span = CauseInSpan(WithLargestOfType(map, found.range), run);
  const std::string compression = CauseInCompression(map);
  if (span.empty() || compression.empty()) return span + compression;
  return span + "; or, if 0 means 'no depth', " + compression;
}

std::string WithCause(const DepthMap& map, const std::string& error, const std::string& cause) {
  const std::string name = (map.source.empty() ? "depth" : map.source) + ": ";
  if (!map.is_lossy || error.compare(0, name.size(), name) != 0) return error + "; " + cause;
  return name + cause + "; " + error.substr(name.size());
}

}  // namespace thicklens
