#include "thicklens/model/depth_holes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

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

// Whether programs use a number of this magnitude as a mark of "no depth".
// `largest_of_type`: the largest value of the file's type, if it may be one; otherwise NaN.
bool IsUsualMark(double magnitude, double largest_of_type) {
  constexpr double kLargestOf16Bits = 65535;
  if (magnitude == kLargestOf16Bits - 1) return true;
  // The largest value of a sensor of 12 to 16 bits.
  for (double largest_of_bits = 4095; largest_of_bits <= kLargestOf16Bits;
       largest_of_bits = 2 * largest_of_bits + 1) {
    if (magnitude == largest_of_bits) return true;
  }
  // Values are floats, in which the largest of 32 bits is rounded.
  const double largest = static_cast<float>(largest_of_type);
  if (magnitude == largest || magnitude == largest - 1) return true;
  constexpr double kMinPower = 1e4, kMaxNines = 1e7;  // floats hold whole numbers up to 1.6e7
  for (double power = 1e3; power <= kMaxNines; power *= 10) {
    if (magnitude == power - 1) return true;
  }
  for (double power = kMinPower; power < std::numeric_limits<float>::max(); power *= 10) {
    if (magnitude == static_cast<double>(static_cast<float>(power))) return true;
  }
  return magnitude == static_cast<double>(std::numeric_limits<float>::max());
}

// The mark of OpenCV's stereo matchers for pixels without a match, the least disparity less 1: -1,
// or -16 in 1/16 px. It is suspected where no other value is below 0, in the smaller part of a map
// that has many other values: some planes, or a wall behind them, are a scene.
std::optional<SuspectedMark> UnmatchedMark(const RawDepthMap& map, double least_pixels) {
  constexpr std::size_t kMinOthers = 16;
  SuspectedMark mark;
  std::vector<float> others;
  for (const float value : map.values) {
    if (!(value < 0)) {
      const bool is_new = !std::isnan(value) && others.size() < kMinOthers &&
                          std::find(others.begin(), others.end(), value) == others.end();
      if (is_new) others.push_back(value);
      continue;
    }
    if (value != -1 && value != -16) return std::nullopt;
    if (mark.pixels > 0 && value != mark.value) return std::nullopt;
    mark.value = value;
    ++mark.pixels;
  }
  const auto pixels = static_cast<double>(mark.pixels);
  const bool is_suspected =
      pixels >= least_pixels && others.size() == kMinOthers && 2 * mark.pixels < map.values.size();
  return is_suspected ? std::optional(mark) : std::nullopt;
}

// Finds them among the values that are left, in which NaN marks the holes.
std::vector<SuspectedMark> SuspectsOf(DepthKind kind, const HoleRules& rules,
                                      const RawDepthMap& map) {
  // The largest magnitudes, the largest first; several marks may lie side by side, 65534 and 65535.
  constexpr std::size_t kMaxMarks = 3;
  std::vector<SuspectedMark> largest;
  std::size_t valid = 0;
  for (const float stored : map.values) {
    if (std::isnan(stored)) continue;
    ++valid;
    const double value = stored;
    auto at = largest.begin();
    while (at != largest.end() && at->value != value && std::abs(at->value) >= std::abs(value))
      ++at;
    if (at != largest.end() && at->value == value) {
      ++at->pixels;
    } else if (at != largest.end() || largest.size() <= kMaxMarks) {
      largest.insert(at, {value, 1});
      if (largest.size() > kMaxMarks + 1) largest.pop_back();
    }
  }
  constexpr double kMinShareOfMark = 1e-3, kMinOthers = 0.01;
  constexpr std::size_t kMinPixels = 8;
  const auto least_pixels =
      std::max<double>(kMinPixels, kMinShareOfMark * static_cast<double>(map.values.size()));
  // Two planes at disparities of 0 and 5 are a scene: of disparity and inverse depth only usual
  // marks are suspected, and only beside two others. Relative maps of 8 bits are scaled to reach
  // 255.
  const bool lengths = HasLengths(kind);
  const double usual_gap = lengths ? 0.8 : 0.5, any_gap = lengths ? 0.01 : 0;
  const std::size_t least_distinct = lengths ? 1 : 2;
  constexpr double kLargestOfByte = 255;
  double largest_of_type = map.largest_of_type.value_or(std::numeric_limits<double>::quiet_NaN());
  if (!lengths && largest_of_type <= kLargestOfByte) {
    largest_of_type = std::numeric_limits<double>::quiet_NaN();
  }
  std::size_t marked = 0, pixels = 0;
  for (std::size_t i = 0; i + 1 < largest.size(); ++i) {
    const double magnitude = std::abs(largest[i].value), next = std::abs(largest[i + 1].value);
    if (static_cast<double>(largest[i].pixels) < least_pixels) break;
    if (rules.largest_is_value && map.largest_of_type && largest[i].value == *map.largest_of_type)
      break;
    pixels += largest[i].pixels;
    const bool is_usual = IsUsualMark(magnitude, largest_of_type);
    // Without other depths there is no scale to compare with.
    const double others = static_cast<double>(valid - pixels) / static_cast<double>(valid);
    if (next < (is_usual ? usual_gap : any_gap) * magnitude && others >= kMinOthers &&
        i + least_distinct < largest.size()) {
      marked = i + 1;
    } else if (!is_usual) {
      break;
    }
  }
  largest.resize(marked);
  if (kind == DepthKind::kDisparity) {
    const std::optional<SuspectedMark> unmatched = UnmatchedMark(map, least_pixels);
    const bool is_listed =
        unmatched && std::any_of(largest.begin(), largest.end(), [&](const SuspectedMark& mark) {
          return mark.value == unmatched->value;
        });
    if (unmatched && !is_listed) largest.push_back(*unmatched);
  }
  return largest;
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
  holes.suspects = SuspectsOf(kind, rules, *map);
  if (!zero_is_hole) map->integer = false;
  return holes;
}

}  // namespace thicklens::model
