#include "thicklens/model/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "model/base/random_draws.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/model/quantised_levels.h"

namespace thicklens::model {
namespace {

constexpr std::size_t kValuesAtOnce = 1 << 16;

constexpr float kHole = std::numeric_limits<float>::quiet_NaN();

std::size_t CountOf(int width, int height, int channels) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height) *
         static_cast<std::size_t>(channels);
}

// Throws Error unless the count is the product of the sizes. `what` is the array's name in the
// message.
void CheckSize(const std::string& what, int width_px, int height_px, int channels,
               std::size_t count) {
  if (width_px < 1 || height_px < 1 || channels < 1 ||
      count != CountOf(width_px, height_px, channels)) {
    throw Error(
        fmt::format("{}: {} values for {}x{} px in {} channels: the count must be the product of "
                    "these numbers, and not 0",
                    what, count, width_px, height_px, channels));
  }
}

void CheckBits(int bits) {
  if (bits != 8 && bits != 16) {
    throw Error(fmt::format("image: {} bits per value: it must be 8 or 16", bits));
  }
}

double FullScale(int bits) {
  CheckBits(bits);
  return bits == 8 ? 255.0 : 65535.0;
}

// Integer level of an encoded value, 1 at `full_scale`.
std::uint16_t RoundedLevel(double stored, double full_scale) {
  const double level = std::floor(stored * full_scale + 0.5);
  // The comparison makes NaN black; a cast of NaN would be undefined.
  return static_cast<std::uint16_t>(level > 0 ? std::min(level, full_scale) : 0.0);
}

// Encoded image; `level_of` gives the level of each value.
template <typename LevelOf>
EncodedImage EncodedBy(const LinearImage& image, int bits, const LevelOf& level_of) {
  CheckSize("image", image.width_px, image.height_px, image.channels, image.values.size());
  EncodedImage stored{image.width_px, image.height_px, image.channels, bits, {}};
  stored.values.resize(image.values.size());
  for (std::size_t first = 0; first < image.values.size(); first += kValuesAtOnce) {
    ThrowIfCancelled();
    const std::size_t last = std::min(first + kValuesAtOnce, image.values.size());
    std::transform(image.values.data() + first, image.values.data() + last,
                   stored.values.data() + first, level_of);
  }
  return stored;
}

void CheckConvention(const DepthConvention& convention, const std::string& depth_name) {
  if (convention.kind == DepthKind::kInverse) {
    if (!std::isfinite(convention.inverse_scale_dpt) || convention.inverse_scale_dpt == 0) {
      throw Error(fmt::format("{}: inverse_scale_dpt is {}: it must be finite and not 0",
                              depth_name, convention.inverse_scale_dpt));
    }
    if (!std::isfinite(convention.inverse_offset_dpt)) {
      throw Error(fmt::format("{}: inverse_offset_dpt is {}: it must be finite", depth_name,
                              convention.inverse_offset_dpt));
    }
    return;
  }
  if (convention.kind != DepthKind::kDisparity) {
    if (!(convention.unit_mm > 0) || !std::isfinite(convention.unit_mm)) {
      throw Error(fmt::format("{}: the depth unit is {} mm: it must be finite and > 0", depth_name,
                              convention.unit_mm));
    }
    return;
  }
  if (!std::isfinite(convention.disparity_scale) || convention.disparity_scale == 0) {
    throw Error(fmt::format("{}: disparity_scale is {}: it must be finite and not 0", depth_name,
                            convention.disparity_scale));
  }
  if (!std::isfinite(convention.disparity_offset_px)) {
    throw Error(fmt::format("{}: disparity_offset_px is {}: it must be finite", depth_name,
                            convention.disparity_offset_px));
  }
  if (!(convention.aperture_step_mm > 0) || !std::isfinite(convention.aperture_step_mm)) {
    throw Error(
        fmt::format("{}: aperture_step_mm is {}: a disparity requires the step between views on "
                    "the aperture, which must be > 0",
                    depth_name, convention.aperture_step_mm));
  }
}

// Converts the numbers of one map to z, mm from Ap.
class DepthConverter {
 public:
  DepthConverter(const Camera& camera, const DepthConvention& convention)
      : convention_(convention), principal_point_px_(camera.sensor.principal_point_px) {
    // These kinds need no calibration.
    if (convention.kind == DepthKind::kZ || convention.kind == DepthKind::kInverse) return;
    focal_scale_px_ = camera.focal_scale_px();
    if (convention.kind == DepthKind::kRange) return;
    inverse_focus_per_mm_ = 1 / camera.focus_depth_mm();
    inverse_per_px_ = 1 / (convention.aperture_step_mm * focal_scale_px_);
  }

  // Depth z, mm from Ap; NaN if the number is no depth in front of the camera. A negative z or
  // range gives a negative depth.
  double DepthMm(double value, int x, int y, bool integer) const {
    constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
    if (!std::isfinite(value)) return kNone;
    const bool zero_is_hole =
        integer || convention_.kind == DepthKind::kZ || convention_.kind == DepthKind::kRange;
    if (value == 0 && zero_is_hole) return kNone;
    switch (convention_.kind) {
      case DepthKind::kZ:
        return value * convention_.unit_mm;
      case DepthKind::kRange:
        return value * convention_.unit_mm / RangeOverDepth(x, y);
      case DepthKind::kInverse: {
        constexpr double kMmPerMetre = 1000;
        const double inverse_dpt =
            convention_.inverse_scale_dpt * value + convention_.inverse_offset_dpt;
        return inverse_dpt > 0 ? kMmPerMetre / inverse_dpt : kNone;
      }
      case DepthKind::kDisparity:
        break;
    }
    // 1/z = 1/zf + d p/(da K), from d = da c(z)/p [D17] with c = K (1/z - 1/zf).
    const double disparity_px =
        convention_.disparity_scale * value + convention_.disparity_offset_px;
    const double inverse_per_mm = inverse_focus_per_mm_ + disparity_px * inverse_per_px_;
    return inverse_per_mm > 0 ? 1 / inverse_per_mm : kNone;
  }

 private:
  // [D18] sqrt(1 + (t p/K)^2): the chief ray of a pixel t px from the principal point has the slope
  // t p/K in front of the lens.
  double RangeOverDepth(int x, int y) const {
    const Eigen::Vector2d slope = (Eigen::Vector2d(x, y) - principal_point_px_) / focal_scale_px_;
    return std::sqrt(1 + slope.squaredNorm());
  }

  const DepthConvention convention_;
  const Eigen::Vector2d principal_point_px_;
  double focal_scale_px_ = 0;        // K/p
  double inverse_focus_per_mm_ = 0;  // 1/zf, 0 for a focus at infinity
  double inverse_per_px_ = 0;        // p/(da K), 1/mm per px of disparity
};

// The median of an even number of depths is the lower of the two middle ones, so that it is a depth
// of the map.
DepthStatistics StatisticsOf(const std::vector<float>& depth_mm) {
  std::vector<float> valid_mm;
  valid_mm.reserve(depth_mm.size());
  std::copy_if(depth_mm.begin(), depth_mm.end(), std::back_inserter(valid_mm),
               [](float z) { return !std::isnan(z); });
  DepthStatistics statistics;
  statistics.valid = valid_mm.size();
  statistics.holes = depth_mm.size() - valid_mm.size();
  if (valid_mm.empty()) return statistics;
  const auto [least, most] = std::minmax_element(valid_mm.begin(), valid_mm.end());
  statistics.min_mm = *least;
  statistics.max_mm = *most;
  const auto middle = valid_mm.begin() + static_cast<std::ptrdiff_t>((valid_mm.size() - 1) / 2);
  std::nth_element(valid_mm.begin(), middle, valid_mm.end());
  statistics.median_mm = *middle;
  return statistics;
}

// Throws Error for depths that are impossible in an image of this camera. A unit that is wrong by a
// factor of 1000 is detected by two conditions, both of which must hold, so that a landscape with a
// near focus, or a close object with a far focus, is still accepted:
//   too large by 1000: every depth is beyond 1000 f1 (no true depth is nearer than f1), and the
//     median is beyond 100 zf (the true one is beyond zf/10);
//   too small by 1000: every depth is within 10 f1 (no true depth is beyond 10^4 f1), and the
//     median is within zf/100 (the true one is within 10 zf).
// Many maps that are too small already contain depths nearer than f1.
void CheckPlausible(const Camera& camera, const DepthStatistics& depth,
                    const std::string& depth_name, const std::string& doubt) {
  const std::string found = fmt::format("{}: depths from {:.6g} to {:.6g} mm, median {:.6g} mm",
                                        depth_name, depth.min_mm, depth.max_mm, depth.median_mm);
  const double front_focal_length_mm = camera.lens.front_focal_length_mm;
  if (!(depth.min_mm > front_focal_length_mm)) {
    throw Error(
        fmt::format("{}: all depths must be beyond the camera's front focal point at {:.6g} mm; {}",
                    found, front_focal_length_mm, doubt));
  }
  if (!camera.calibration || !camera.calibration->image_distance_mm) return;
  const double focus_depth_mm = camera.focus_depth_mm();
  if (std::isinf(focus_depth_mm)) return;
  const bool too_large =
      depth.min_mm > 1000 * front_focal_length_mm && depth.median_mm > 100 * focus_depth_mm;
  const bool too_small =
      depth.max_mm < 10 * front_focal_length_mm && depth.median_mm < focus_depth_mm / 100;
  if (too_large || too_small) {
    throw Error(fmt::format(
        "{}: too {} for a camera focused at {:.6g} mm, as if the unit were off by a factor of "
        "1000; {}",
        found, too_large ? "far" : "near", focus_depth_mm, doubt));
  }
}

}  // namespace

QuantisedLevels::QuantisedLevels(const TransferCurve& transfer, int bits) : bits_(bits) {
  const double full_scale = FullScale(bits);
  const auto level_of = [&](float light) {
    return RoundedLevel(transfer.Encode(light), full_scale);
  };
  least_light_.push_back(0);
  for (int level = 1; level <= static_cast<int>(full_scale); ++level) {
    // Decode is the inverse of Encode up to rounding, which may reach the next float.
    auto least = static_cast<float>(transfer.Decode((level - 0.5) / full_scale));
    while (level_of(least) >= level) least = std::nextafter(least, 0.0F);
    while (level_of(least) < level) least = std::nextafter(least, 2.0F);
    least_light_.push_back(least);
  }
  lowest_level_.resize(CellOf(1) + 1);
  for (std::size_t level = 1; level < least_light_.size(); ++level) {
    // The level is the minimum from the cell after the one in which it begins.
    const std::size_t cell = CellOf(least_light_[level]) + 1;
    if (cell < lowest_level_.size()) lowest_level_[cell] = static_cast<std::uint16_t>(level);
  }
  for (std::size_t cell = 1; cell < lowest_level_.size(); ++cell) {
    lowest_level_[cell] = std::max(lowest_level_[cell], lowest_level_[cell - 1]);
  }
}

LinearImage ToLinear(const EncodedImage& image, const TransferCurve& transfer) {
  CheckBits(image.bits);
  CheckSize("image", image.width_px, image.height_px, image.channels, image.values.size());
  // A table with one entry for each possible value costs far less than a power function per pixel.
  std::vector<float> light_of(static_cast<std::size_t>(image.full_scale()) + 1);
  for (std::size_t value = 0; value < light_of.size(); ++value) {
    light_of[value] =
        static_cast<float>(transfer.Decode(static_cast<double>(value) / image.full_scale()));
  }
  LinearImage linear{image.width_px, image.height_px, image.channels, {}};
  linear.values.reserve(image.values.size());
  for (const std::uint16_t value : image.values) {
    if (linear.values.size() % kValuesAtOnce == 0) ThrowIfCancelled();
    if (value >= light_of.size()) {
      throw Error(fmt::format("image: a value is {}: at {} bits it must be at most {}", value,
                              image.bits, image.full_scale()));
    }
    linear.values.push_back(light_of[value]);
  }
  return linear;
}

EncodedImage ToEncoded(const LinearImage& image, const TransferCurve& transfer, int bits) {
  const double full_scale = FullScale(bits);
  return EncodedBy(image, bits,
                   [&](float light) { return RoundedLevel(transfer.Encode(light), full_scale); });
}

EncodedImage ToEncoded(const LinearImage& image, const QuantisedLevels& levels) {
  return EncodedBy(image, levels.bits(), [&](float light) { return levels.LevelOf(light); });
}

EncodedImage ToEncodedWithNoise(const LinearImage& image, const TransferCurve& transfer, int bits,
                                double sigma, std::uint64_t seed) {
  if (!(sigma >= 0) || !std::isfinite(sigma)) {
    throw Error(
        fmt::format("image: the noise is {} full scales: it must be finite and >= 0", sigma));
  }
  if (sigma == 0) return ToEncoded(image, transfer, bits);
  const double full_scale = FullScale(bits);
  RandomDraws draws(seed, RandomDraws::Purpose::kEncodedNoise, 0);
  return EncodedBy(image, bits, [&](float light) {
    return RoundedLevel(transfer.Encode(light) + sigma * draws.Normal(), full_scale);
  });
}

LinearImage ToGrey(const LinearImage& image) {
  CheckSize("image", image.width_px, image.height_px, image.channels, image.values.size());
  if (image.channels == 1) return image;
  if (image.channels != 3 && image.channels != 4) {
    throw Error(fmt::format(
        "image: {} channels: it must have 1 (grey), 3 (RGB) or 4 (RGB and alpha)", image.channels));
  }
  LinearImage grey{image.width_px, image.height_px, 1, {}};
  const auto step = static_cast<std::size_t>(image.channels);
  grey.values.reserve(image.values.size() / step);
  for (std::size_t i = 0; i < image.values.size(); i += step) {
    grey.values.push_back(0.2126F * image.values[i] + 0.7152F * image.values[i + 1] +
                          0.0722F * image.values[i + 2]);
  }
  return grey;
}

std::string DepthFlipName(DepthFlip flip) {
  switch (flip) {
    case DepthFlip::kRows:
      return "rows";
    case DepthFlip::kColumns:
      return "columns";
    case DepthFlip::kBoth:
      return "both";
    case DepthFlip::kNone:
      break;
  }
  return "none";
}

DepthFlip DepthFlipFromName(const std::string& name) {
  for (const DepthFlip flip :
       {DepthFlip::kNone, DepthFlip::kRows, DepthFlip::kColumns, DepthFlip::kBoth}) {
    if (name == DepthFlipName(flip)) return flip;
  }
  throw Error(
      fmt::format("flip of a depth map: none, rows, columns or both is expected, found '{}'",
                  PrintableUtf8(name)));
}

DepthFlip Combined(DepthFlip first, DepthFlip second) {
  const auto has = [](DepthFlip flip, DepthFlip part) {
    return flip == part || flip == DepthFlip::kBoth;
  };
  const bool rows = has(first, DepthFlip::kRows) != has(second, DepthFlip::kRows);
  const bool columns = has(first, DepthFlip::kColumns) != has(second, DepthFlip::kColumns);
  if (rows && columns) return DepthFlip::kBoth;
  return rows ? DepthFlip::kRows : columns ? DepthFlip::kColumns : DepthFlip::kNone;
}

void FlipDepth(DepthFlip flip, int width_px, std::vector<float>* values) {
  if (width_px < 1 || values->size() % static_cast<std::size_t>(width_px) != 0) {
    throw Error(fmt::format("flip of a depth map: {} values are no full rows of {} px",
                            values->size(), width_px));
  }
  // Turned by 180 degrees, all values are in the opposite order; with the rows in their own order
  // again, only the columns are reversed.
  if (flip == DepthFlip::kRows || flip == DepthFlip::kBoth)
    std::reverse(values->begin(), values->end());
  if (flip == DepthFlip::kRows || flip == DepthFlip::kColumns) {
    for (auto row = values->begin(); row != values->end(); row += width_px)
      std::reverse(row, row + width_px);
  }
}

DepthKind DepthKindFromName(const std::string& name) {
  if (name == "z") return DepthKind::kZ;
  if (name == "range") return DepthKind::kRange;
  if (name == "disparity") return DepthKind::kDisparity;
  if (name == "inverse") return DepthKind::kInverse;
  throw Error(
      fmt::format("depth kind \"{}\" is unknown: it must be z, range, disparity or inverse", name));
}

InverseScale InverseScaleBetween(double depth_at_zero_mm, double depth_at_full_scale_mm,
                                 double full_scale) {
  if (!(depth_at_zero_mm > 0) || !(depth_at_full_scale_mm > 0) ||
      depth_at_zero_mm == depth_at_full_scale_mm) {
    throw Error(fmt::format("inverse depth from {} to {} mm: two different depths > 0 are expected",
                            depth_at_zero_mm, depth_at_full_scale_mm));
  }
  if (!(full_scale > 0) || !std::isfinite(full_scale)) {
    throw Error(
        fmt::format("inverse depth: the full scale is {}: it must be finite and > 0", full_scale));
  }
  constexpr double kMmPerMetre = 1000;
  const double at_zero_dpt = kMmPerMetre / depth_at_zero_mm;
  const double at_full_scale_dpt = kMmPerMetre / depth_at_full_scale_mm;
  return {(at_full_scale_dpt - at_zero_dpt) / full_scale, at_zero_dpt};
}

double DepthUnitMm(const std::string& name) {
  if (name == "mm") return 1;
  if (name == "cm") return 10;
  if (name == "m") return 1000;
  if (name == "tum5000") return 0.2;
  throw Error(fmt::format("depth unit \"{}\" is unknown: it must be mm, cm, m or tum5000", name));
}

Scene MakeScene(const Camera& camera, LinearImage image, const RawDepthMap& map,
                const DepthConvention& convention, const std::string& depth_name) {
  CheckSize("image", image.width_px, image.height_px, image.channels, image.values.size());
  CheckSize(depth_name, map.width_px, map.height_px, 1, map.values.size());
  if (map.width_px != image.width_px || map.height_px != image.height_px) {
    throw Error(
        fmt::format("{}: it has {}x{} px, but the image has {}x{} px: the sizes must be equal",
                    depth_name, map.width_px, map.height_px, image.width_px, image.height_px));
  }
  CheckConvention(convention, depth_name);

  const DepthConverter converter(camera, convention);
  Scene scene;
  scene.depth_mm.reserve(map.values.size());
  for (int y = 0; y < map.height_px; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < map.width_px; ++x) {
      const float value = map.values[scene.depth_mm.size()];
      const double depth_mm = converter.DepthMm(value, x, y, map.integer);
      if (depth_mm < 0) {
        throw Error(
            fmt::format("{}: the value at pixel ({}, {}) is {}: a depth must not be "
                        "negative",
                        depth_name, x, y, value));
      }
      // A depth above the maximum of float is at infinity, which is a hole.
      const bool is_depth = depth_mm <= std::numeric_limits<float>::max();
      scene.depth_mm.push_back(is_depth ? static_cast<float>(depth_mm) : kHole);
    }
  }
  scene.depth = StatisticsOf(scene.depth_mm);
  if (scene.depth.valid == 0) {
    throw Error(fmt::format("{}: all of its {} values are holes: at least one must be a depth",
                            depth_name, map.values.size()));
  }
  CheckPlausible(camera, scene.depth, depth_name,
                 convention.kind == DepthKind::kDisparity
                     ? "check the scale and the offset of the disparity, and that the map does not "
                       "contain depths"
                 : convention.kind == DepthKind::kInverse
                     ? "check the scale and the offset of the inverse depth, or its near and far "
                       "depth"
                     : "check the unit");
  scene.image = std::move(image);
  return scene;
}

}  // namespace thicklens::model
