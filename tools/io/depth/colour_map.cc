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
#include <string>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/pi.h"
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

// Maps of matplotlib that OpenCV lacks, by points at equal distances with straight lines between
// them; a reversed map ("Spectral_r") has the same colours. Spectral and Blues are colour schemes
// of ColorBrewer (Copyright 2002 Cynthia Brewer, Mark Harrower and The Pennsylvania State
// University, Apache License 2.0). coolwarm is sampled from the diverging map that K. Moreland
// describes in "Diverging Color Maps for Scientific Visualization", 2009; the lines are within 3
// levels of it. nipy_spectral has the points of nipy (BSD licence).
constexpr Colour kSpectral[] = {{158, 1, 66},    {213, 62, 79},   {244, 109, 67},  {253, 174, 97},
                                {254, 224, 139}, {255, 255, 191}, {230, 245, 152}, {171, 221, 164},
                                {102, 194, 165}, {50, 136, 189},  {94, 79, 162}};
constexpr Colour kBlues[] = {{247, 251, 255}, {222, 235, 247}, {198, 219, 239},
                             {158, 202, 225}, {107, 174, 214}, {66, 146, 198},
                             {33, 113, 181},  {8, 81, 156},    {8, 48, 107}};
constexpr Colour kCoolwarm[] = {{59, 76, 192},   {78, 104, 216},  {98, 130, 234},  {119, 154, 247},
                                {141, 176, 254}, {163, 194, 254}, {185, 208, 249}, {204, 217, 237},
                                {221, 220, 220}, {235, 211, 198}, {244, 197, 173}, {247, 177, 148},
                                {244, 154, 123}, {236, 127, 99},  {222, 97, 77},   {203, 62, 56},
                                {180, 4, 38}};
constexpr Colour kNipySpectral[] = {
    {0, 0, 0},     {119, 0, 136}, {136, 0, 153},  {0, 0, 170},   {0, 0, 221},   {0, 119, 221},
    {0, 153, 221}, {0, 170, 170}, {0, 170, 136},  {0, 153, 0},   {0, 187, 0},   {0, 221, 0},
    {0, 255, 0},   {187, 255, 0}, {238, 238, 0},  {255, 204, 0}, {255, 153, 0}, {255, 0, 0},
    {221, 0, 0},   {204, 0, 0},   {204, 204, 204}};

constexpr int kMapColours = 256;

template <std::size_t count>
std::vector<Colour> ColoursBetween(const Colour (&points)[count]) {  // NOLINT: tables
  std::vector<Colour> colours;
  for (int i = 0; i < kMapColours; ++i) {
    const double place = static_cast<double>(i) * (count - 1) / (kMapColours - 1);
    const auto before = std::min(static_cast<std::size_t>(place), count - 2);
    const double share = place - static_cast<double>(before);
    Colour colour{};
    for (std::size_t c = 0; c < 3; ++c)
      colour[c] = static_cast<int>(
          std::lround((1 - share) * points[before][c] + share * points[before + 1][c]));
    colours.push_back(colour);
  }
  return colours;
}

// matplotlib's rainbow, which is gnuplot's formula: |2 x - 1/2|, sin(pi x), cos(pi x/2).
std::vector<Colour> RainbowOfMatplotlib() {
  std::vector<Colour> colours;
  for (int i = 0; i < kMapColours; ++i) {
    const double x = static_cast<double>(i) / (kMapColours - 1);
    const auto level = [](double value) {
      return static_cast<int>(std::lround(255 * std::clamp(value, 0.0, 1.0)));
    };
    colours.push_back(
        {level(std::abs(2 * x - 0.5)), level(std::sin(kPi * x)), level(std::cos(kPi * x / 2))});
  }
  return colours;
}

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

struct TabledMap {
  std::string name;
  std::vector<Colour> colours;
};

std::vector<TabledMap> AllMaps() {
  std::vector<TabledMap> maps;
  for (const NamedMap& map : kColourMaps) maps.push_back({map.name, ColoursOf(map.code)});
  maps.push_back({"Spectral", ColoursBetween(kSpectral)});
  maps.push_back({"Blues", ColoursBetween(kBlues)});
  maps.push_back({"coolwarm", ColoursBetween(kCoolwarm)});
  maps.push_back({"nipy_spectral", ColoursBetween(kNipySpectral)});
  maps.push_back({"rainbow of matplotlib", RainbowOfMatplotlib()});
  return maps;
}

// The difference between the channels that 99 % of the samples do not exceed, in levels.
int UsualSpread(const std::vector<Colour>& samples) {
  std::vector<int> spreads;
  for (const Colour& sample : samples) {
    const auto [least, most] = std::minmax_element(sample.begin(), sample.end());
    spreads.push_back(*most - *least);
  }
  const auto at = spreads.begin() + static_cast<std::ptrdiff_t>(99 * (spreads.size() - 1) / 100);
  std::nth_element(spreads.begin(), at, spreads.end());
  return *at;
}

struct Match {
  std::string name;
  double share = 0;        // of the samples that lie on the map
  double mean_levels = 0;  // their mean distance from it
  std::size_t parts = 0;   // how many of the 32 parts of the map they use
};

// A few colours lie on some map by chance.
constexpr std::size_t kMinParts = 3;

// None if no sample lies on the map, or if all that do lie on so few of its parts that this may be
// chance and they are not its very colours.
std::optional<Match> MatchOf(const std::vector<Colour>& samples, const TabledMap& map,
                             int tolerance) {
  const std::vector<Colour>& colours = map.colours;
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
  constexpr int kNearlyGrey = 10;  // levels; the greys of the map bone differ by up to 28
  const int spread = samples.empty() ? 0 : UsualSpread(samples);
  if (!samples.empty() && spread <= kNearlyGrey) {
    return fmt::format(
        "its channels differ, but by little (99 % of its pixels by at most {} of 255 levels), as "
        "lossy compression or a tint leaves them: save one channel",
        spread);
  }
  for (const TabledMap& map : AllMaps()) {
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
  std::string words =
      "its channels differ, and its colours lie on no known colour map: it is not a depth map";
  if (rgb.depth() == CV_8U && !is_lossy) {
    words +=
        ", unless the three bytes of a pixel are one number, as CARLA stores depth: then save it "
        "as "
        "NPY, in Python numpy.save('depth.npy', 1000*(R + 256.0*G + 65536.0*B)/(2**24 - 1)), in m";
  }
  return words;
}

}  // namespace thicklens::io
