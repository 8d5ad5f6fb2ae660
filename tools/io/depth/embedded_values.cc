// Turns the stored numbers of an embedded depth map into depths, and into the photograph's size.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/io/depth_io.h"
#include "tools/io/image_file_kind.h"

namespace thicklens::io {
namespace {

// A pixel and its right or lower neighbour, and the weight of the latter.
struct Neighbours {
  std::size_t first = 0, second = 0;
  double weight = 0;
};

// The centre of pixel i of `many` lies at (i + 0.5) few/many - 0.5 in a row of `few`, since both
// rows begin and end at the same edges.
std::vector<Neighbours> NeighboursOf(int few, int many) {
  std::vector<Neighbours> all;
  all.reserve(static_cast<std::size_t>(many));
  for (int i = 0; i < many; ++i) {
    const double at = std::clamp((i + 0.5) * few / many - 0.5, 0.0, few - 1.0);
    const auto first = static_cast<std::size_t>(at);
    const auto second = std::min(first + 1, static_cast<std::size_t>(few - 1));
    all.push_back({first, second, at - static_cast<double>(first)});
  }
  return all;
}

float Between(float a, float b, float c, float d, double right, double down) {
  const double upper = a + right * (b - a), lower = c + right * (d - c);
  return static_cast<float>(upper + down * (lower - upper));
}

// Phones crop and round: the sides may differ by a pixel of the map.
bool HasAspectOf(const model::RawDepthMap& map, int width_px, int height_px) {
  const double height =
      static_cast<double>(map.width_px) * height_px / static_cast<double>(width_px);
  const double width =
      static_cast<double>(map.height_px) * width_px / static_cast<double>(height_px);
  return std::abs(height - map.height_px) <= 1 || std::abs(width - map.width_px) <= 1;
}

}  // namespace

model::RawDepthMap DepthsOf(const EmbeddedDepth& depth) {
  constexpr double kMmPerMetre = 1000;
  model::RawDepthMap map;
  map.width_px = depth.map.width_px;
  map.height_px = depth.map.height_px;
  map.values.reserve(depth.map.values.size());
  const bool turns = depth.is_inverse && depth.kind != model::DepthKind::kInverse;
  for (const float number : depth.map.values) {
    const double value = depth.offset + depth.scale * static_cast<double>(number);
    map.values.push_back(static_cast<float>(turns ? kMmPerMetre / value : value));
  }
  return map;
}

EmbeddedDepth Enlarged(const EmbeddedDepth& depth, int width_px, int height_px,
                       const std::string& name) {
  const model::RawDepthMap& small = depth.map;
  if (small.width_px == width_px && small.height_px == height_px) return depth;
  if (!HasAspectOf(small, width_px, height_px)) {
    throw Error(fmt::format(
        "{}: the depth map inside is {} x {} px, the photograph {} x {} px: an equal aspect ratio "
        "is expected, otherwise it is unknown which part of the photograph the map shows; take the "
        "map as it is, bring it to the photograph's pixels, and give it as a depth map of its own",
        name, small.width_px, small.height_px, width_px, height_px));
  }
  if (small.width_px > width_px || small.height_px > height_px) {
    throw Error(
        fmt::format("{}: the depth map inside is {} x {} px, the photograph only {} x {} px: was "
                    "the photograph "
                    "made smaller? Take it as the camera wrote it",
                    name, small.width_px, small.height_px, width_px, height_px));
  }
  RequireMemory(width_px, height_px, sizeof(float), name + ": its depth map");
  EmbeddedDepth large = depth;
  large.map.width_px = width_px;
  large.map.height_px = height_px;
  large.map.values.clear();
  large.map.values.reserve(static_cast<std::size_t>(width_px) *
                           static_cast<std::size_t>(height_px));
  const std::vector<Neighbours> columns = NeighboursOf(small.width_px, width_px);
  for (const Neighbours& row : NeighboursOf(small.height_px, height_px)) {
    ThrowIfCancelled();
    const auto width = static_cast<std::size_t>(small.width_px);
    const float* const upper = small.values.data() + row.first * width;
    const float* const lower = small.values.data() + row.second * width;
    for (const Neighbours& column : columns) {
      const float a = upper[column.first], b = upper[column.second];
      const float c = lower[column.first], d = lower[column.second];
      const bool has_hole = std::isnan(a) || std::isnan(b) || std::isnan(c) || std::isnan(d);
      const float nearest =
          (row.weight < 0.5 ? upper : lower)[column.weight < 0.5 ? column.first : column.second];
      large.map.values.push_back(has_hole ? nearest
                                          : Between(a, b, c, d, column.weight, row.weight));
    }
  }
  large.notes.push_back(
      fmt::format("The map has {} x {} px and is enlarged to {} x {} px: its edges are as coarse "
                  "as its pixels, "
                  "{:.3g} px of the photograph.",
                  small.width_px, small.height_px, width_px, height_px,
                  static_cast<double>(width_px) / small.width_px));
  return large;
}

}  // namespace thicklens::io
