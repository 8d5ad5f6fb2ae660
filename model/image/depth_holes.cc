#include "thicklens/model/depth_holes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

bool HasLengths(DepthKind kind) { return kind == DepthKind::kZ || kind == DepthKind::kRange; }

// Whether most of the values that are not 0 are negative.
bool IsMostlyNegative(const std::vector<float>& values) {
  std::size_t below = 0, above = 0;
  for (const float value : values) {
    if (value < 0) ++below;
    if (value > 0) ++above;
  }
  return below > above;
}

// The largest value of the type, if it looks like a mark.
double MarkOfType(const RawDepthMap& map, const std::vector<double>& listed) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  constexpr double kLargestOfByte = 255, kGap = 0.9;
  if (!map.largest_of_type || *map.largest_of_type <= kLargestOfByte) return kNone;
  // Values are floats: that is how the largest one was stored.
  const double largest = static_cast<float>(*map.largest_of_type);
  double next = 0;
  for (const float value : map.values) {
    const bool is_hole = std::find(listed.begin(), listed.end(), value) != listed.end();
    if (value < largest && !is_hole) next = std::max<double>(next, value);
  }
  return next > 0 && next < kGap * largest ? largest : kNone;
}

// Whether most zeros, if there are some, have neighbours in the row and in the column that are all
// 0.
bool DoZerosFormAreas(const RawDepthMap& map) {
  const auto width = static_cast<std::size_t>(map.width_px);
  const auto height = static_cast<std::size_t>(map.height_px);
  const auto is_zero = [&](std::size_t x, std::size_t y) { return map.values[y * width + x] == 0; };
  std::size_t zeros = 0, inner = 0;
  for (std::size_t y = 0; y < height; ++y) {
    ThrowIfCancelled();
    for (std::size_t x = 0; x < width; ++x) {
      if (!is_zero(x, y)) continue;
      ++zeros;
      const bool is_inner = (x == 0 || is_zero(x - 1, y)) &&
                            (x + 1 == width || is_zero(x + 1, y)) &&
                            (y == 0 || is_zero(x, y - 1)) && (y + 1 == height || is_zero(x, y + 1));
      if (is_inner) ++inner;
    }
  }
  constexpr double kMinShare = 0.02, kInnerShare = 0.8;
  const auto all = static_cast<double>(map.values.size());
  return static_cast<double>(zeros) >= kMinShare * all &&
         static_cast<double>(inner) >= kInnerShare * static_cast<double>(zeros);
}

}  // namespace

bool HoleRules::IsValid(DepthKind kind, std::string* why) const {
  const auto fail = [why](const std::string& reason) {
    if (why != nullptr) *why = reason;
    return false;
  };
  if (zero_is_value && HasLengths(kind)) {
    return fail(
        "zero_is_value: a z or a range of 0 is not a depth: the kind must be disparity or "
        "inverse");
  }
  for (const double value : hole_values) {
    if (!std::isfinite(value)) {
      return fail(fmt::format("hole_values: a finite number is expected, found {}", value));
    }
  }
  return true;
}

std::size_t DepthHoles::total() const {
  return not_a_number + infinite + listed + zero + negative + largest;
}

std::string DepthHoles::InWords() const {
  const std::pair<const char*, std::size_t> reasons[] = {{"0", zero},
                                                         {"NaN", not_a_number},
                                                         {"infinite", infinite},
                                                         {"negative", negative},
                                                         {"largest of the type", largest},
                                                         {"given hole value", listed}};
  std::string words;
  for (const auto& [name, count] : reasons) {
    if (count == 0) continue;
    words += fmt::format("{}{}: {:.1f} %", words.empty() ? "" : ", ", name,
                         100 * static_cast<double>(count) / static_cast<double>(pixels));
  }
  return words;
}

DepthHoles MarkHoles(DepthKind kind, const HoleRules& rules, RawDepthMap* map) {
  std::string why;
  if (!rules.IsValid(kind, &why)) throw Error(why);
  if (map->width_px < 1 || map->height_px < 1 ||
      map->values.size() !=
          static_cast<std::size_t>(map->width_px) * static_cast<std::size_t>(map->height_px)) {
    throw Error(fmt::format("depth map: {} values for {}x{} px", map->values.size(), map->width_px,
                            map->height_px));
  }
  // A file of floats holds the float nearest to the value that the user gives.
  std::vector<double> listed;
  for (const double value : rules.hole_values) listed.push_back(static_cast<float>(value));
  const bool zero_is_hole = HasLengths(kind) || (map->integer && !rules.zero_is_value);
  const bool negative_is_hole = HasLengths(kind) && !IsMostlyNegative(map->values);
  const double mark = HasLengths(kind) && !rules.largest_is_value
                          ? MarkOfType(*map, listed)
                          : std::numeric_limits<double>::quiet_NaN();
  DepthHoles holes;
  holes.pixels = map->values.size();
  holes.zeros_form_areas = zero_is_hole && !HasLengths(kind) && DoZerosFormAreas(*map);
  for (float& value : map->values) {
    std::size_t* reason = nullptr;
    if (std::isnan(value)) {
      reason = &holes.not_a_number;
    } else if (std::isinf(value)) {
      reason = &holes.infinite;
    } else if (std::find(listed.begin(), listed.end(), value) != listed.end()) {
      reason = &holes.listed;
    } else if (value == 0 && zero_is_hole) {
      reason = &holes.zero;
    } else if (value < 0 && negative_is_hole) {
      reason = &holes.negative;
    } else if (value == mark) {
      reason = &holes.largest;
    }
    if (reason == nullptr) continue;
    ++*reason;
    value = std::numeric_limits<float>::quiet_NaN();
  }
  if (!zero_is_hole) map->integer = false;
  return holes;
}

}  // namespace thicklens::model
