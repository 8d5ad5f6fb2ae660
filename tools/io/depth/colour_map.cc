// Recognises images of depths in false colours.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>
#include <vector>

#include "thicklens/base/cancel.h"
#include "tools/io/depth/depth_readers.h"

namespace thicklens::io {
namespace {

struct NamedMap {
  const char* name;
  int code;
};
constexpr NamedMap kColourMaps[] = {
    {"jet", cv::COLORMAP_JET},         {"turbo", cv::COLORMAP_TURBO},
    {"viridis", cv::COLORMAP_VIRIDIS}, {"plasma", cv::COLORMAP_PLASMA},
    {"inferno", cv::COLORMAP_INFERNO}, {"magma", cv::COLORMAP_MAGMA},
    {"cividis", cv::COLORMAP_CIVIDIS}, {"parula", cv::COLORMAP_PARULA},
    {"hot", cv::COLORMAP_HOT},         {"hsv", cv::COLORMAP_HSV},
    {"rainbow", cv::COLORMAP_RAINBOW}, {"bone", cv::COLORMAP_BONE},
    {"pink", cv::COLORMAP_PINK},       {"cool", cv::COLORMAP_COOL},
    {"ocean", cv::COLORMAP_OCEAN},     {"spring", cv::COLORMAP_SPRING},
    {"summer", cv::COLORMAP_SUMMER},   {"autumn", cv::COLORMAP_AUTUMN},
    {"winter", cv::COLORMAP_WINTER},   {"twilight", cv::COLORMAP_TWILIGHT}};

using Colour = std::array<int, 3>;  // red, green, blue, 0 to 255

std::vector<Colour> ColoursOf(int code) {
  cv::Mat ramp(1, 256, CV_8U);
  for (int i = 0; i < ramp.cols; ++i) ramp.at<std::uint8_t>(0, i) = static_cast<std::uint8_t>(i);
  cv::Mat mapped;
  cv::applyColorMap(ramp, mapped, code);
  std::vector<Colour> colours;
  for (int i = 0; i < mapped.cols; ++i) {
    const auto& blue_first = mapped.at<cv::Vec3b>(0, i);
    colours.push_back({blue_first[2], blue_first[1], blue_first[0]});
  }
  return colours;
}

// At most about 4000 pixels, evenly spread, as 8 bits. Empty if the values have no full scale.
std::vector<Colour> Samples(const cv::Mat& rgb) {
  double full_scale = 0;
  if (rgb.depth() == CV_8U) full_scale = 255;
  if (rgb.depth() == CV_16U) full_scale = 65535;
  if (rgb.depth() == CV_32F || rgb.depth() == CV_64F) {
    double least = 0, most = 0;
    cv::minMaxIdx(rgb.reshape(1), &least, &most);
    if (!(least >= 0) || !std::isfinite(most)) return {};
    full_scale = most <= 1 ? 1 : most <= 255 ? 255 : 0;
  }
  if (full_scale == 0) return {};
  constexpr double kMost = 4000;
  const auto step =
      static_cast<int>(std::max(1.0, std::sqrt(static_cast<double>(rgb.total()) / kMost)));
  std::vector<Colour> samples;
  for (int y = 0; y < rgb.rows; y += step) {
    ThrowIfCancelled();
    cv::Mat row;
    rgb.row(y).convertTo(row, CV_32F, 255 / full_scale);
    const auto* values = row.ptr<float>(0);
    for (int x = 0; x < rgb.cols; x += step) {
      Colour colour{};
      for (std::size_t c = 0; c < 3; ++c) {
        const float value = values[3 * static_cast<std::size_t>(x) + c];
        colour[c] = std::isfinite(value) ? static_cast<int>(std::lround(value)) : -1000;
      }
      samples.push_back(colour);
    }
  }
  return samples;
}

int Distance(const Colour& a, const Colour& b) {
  return std::max({std::abs(a[0] - b[0]), std::abs(a[1] - b[1]), std::abs(a[2] - b[2])});
}

struct Match {
  const char* name = "";
  double share = 0;        // of the samples that lie on the map
  double mean_levels = 0;  // their mean distance from it
  std::size_t parts = 0;   // how many of the 32 parts of the map they use
};

// A few colours lie on some map by chance.
constexpr std::size_t kMinParts = 3;

// None if no sample lies on the map, or if all that do lie on so few of its parts that this may be
// chance and they are not its very colours.
std::optional<Match> MatchOf(const std::vector<Colour>& samples, const NamedMap& map,
                             int tolerance) {
  const std::vector<Colour> colours = ColoursOf(map.code);
  std::set<std::size_t> used;
  double near = 0, sum = 0;
  for (const Colour& sample : samples) {
    const auto nearest = std::min_element(colours.begin(), colours.end(),
                                          [&](const Colour& left, const Colour& right) {
                                            return Distance(sample, left) < Distance(sample, right);
                                          });
    const int distance = Distance(sample, *nearest);
    if (distance > tolerance) continue;
    ++near;
    sum += distance;
    used.insert(static_cast<std::size_t>(nearest - colours.begin()) / 8);
  }
  constexpr double kVeryColours = 3;  // levels; rounding of the map's definitions
  const bool is_chance = used.size() < 2 || (used.size() < kMinParts && sum / near > kVeryColours);
  if (near == 0 || is_chance) return std::nullopt;
  return Match{map.name, near / static_cast<double>(samples.size()), sum / near, used.size()};
}

}  // namespace

std::string WordsOnColours(const cv::Mat& rgb, bool is_lossy) {
  const std::vector<Colour> samples = Samples(rgb);
  // Programs differ by some levels in the same map.
  const int tolerance = is_lossy ? 24 : 12;
  std::optional<Match> best;
  for (const NamedMap& map : kColourMaps) {
    if (samples.empty()) break;
    const std::optional<Match> match = MatchOf(samples, map, tolerance);
    if (!match) continue;
    const bool is_better =
        !best || match->share > best->share + 0.01 ||
        (match->share > best->share - 0.01 && match->mean_levels < best->mean_levels);
    if (is_better) best = match;
  }
  constexpr double kSure = 0.95, kLikely = 0.75;
  if (best && best->share >= kLikely) {
    const bool is_sure = best->share >= kSure && best->parts >= kMinParts;
    return fmt::format(
        "it is {}an image in the colours of the map '{}' ({:.1f} % of its pixels lie within {} "
        "levels of them{}): save the depth itself, one channel, instead of its image",
        is_sure ? "" : "probably ", best->name, 100 * best->share, tolerance,
        best->parts >= kMinParts ? "" : ", though it has few colours");
  }
  return "its channels differ, and its colours lie on no known colour map: it is not a depth map";
}

}  // namespace thicklens::io
