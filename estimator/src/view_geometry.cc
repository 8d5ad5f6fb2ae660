#include "thicklens/estimator/view_geometry.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "catmull_rom.h"
#include "thicklens/error.h"

namespace thicklens::estimator {
namespace {

constexpr float kHole = std::numeric_limits<float>::quiet_NaN();

// A pixel whose disparity differs by more, px per view step, is not of the sample's surface.
constexpr double kSamePointPx = 0.3;

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

void CheckCount(const char* what, int width_px, int height_px, int channels, std::size_t count) {
  if (width_px < 1 || height_px < 1 || channels < 1 ||
      count != Index(width_px) * Index(height_px) * Index(channels)) {
    throw Error(
        fmt::format("{}: {} values for {}x{} px in {} channels: the count must be the product, "
                    "and not 0",
                    what, count, width_px, height_px, channels));
  }
}

// The farthest of the nearest known pixels to the left, right, above and below each pixel. NaN
// where there is none.
class FarthestNeighbours {
 public:
  explicit FarthestNeighbours(const DisparityMap& map)
      : map_(map), farthest_(map.disparity.size(), kHole) {
    for (int y = 0; y < map.height_px; ++y) Sweep(IndexOf(0, y), 1, map.width_px);
    for (int x = 0; x < map.width_px; ++x) Sweep(IndexOf(x, 0), map.width_px, map.height_px);
  }

  float at(std::size_t i) const { return farthest_[i]; }

 private:
  std::ptrdiff_t IndexOf(int x, int y) const {
    return static_cast<std::ptrdiff_t>(y) * map_.width_px + x;
  }

  // Along a row or a column, there and back.
  void Sweep(std::ptrdiff_t start, std::ptrdiff_t stride, int count) {
    float known = kHole;
    for (int n = 0; n < count; ++n) Pass(start + n * stride, &known);
    known = kHole;
    for (int n = count - 1; n >= 0; --n) Pass(start + n * stride, &known);
  }

  void Pass(std::ptrdiff_t index, float* known) {
    const auto i = static_cast<std::size_t>(index);
    farthest_[i] = std::fmin(farthest_[i], *known);  // fmin: a NaN gives way
    if (!std::isnan(map_.disparity[i])) *known = map_.disparity[i];
  }

  const DisparityMap& map_;
  std::vector<float> farthest_;
};

// The lowest and the highest disparity of the 4 x 4 pixels from (x - 1, y - 1) to (x + 2, y + 2),
// repeated at the borders.
class DisparityRange {
 public:
  explicit DisparityRange(const DisparityMap& map)
      : low_(map.disparity), high_(map.disparity), width_px_(map.width_px) {
    for (int y = 0; y < map.height_px; ++y) Widen(Index(y) * Index(width_px_), 1, width_px_);
    for (int x = 0; x < width_px_; ++x) Widen(Index(x), Index(width_px_), map.height_px);
  }

  float low(int x, int y) const { return low_[Index(y) * Index(width_px_) + Index(x)]; }
  float high(int x, int y) const { return high_[Index(y) * Index(width_px_) + Index(x)]; }

 private:
  // Replaces each number of a row or column by the extremes of those at -1, 0, 1 and 2.
  void Widen(std::size_t start, std::size_t stride, int count) {
    float low_before = low_[start];
    float high_before = high_[start];
    for (int n = 0; n < count; ++n) {
      const std::size_t here = start + Index(n) * stride;
      const std::size_t next = start + Index(std::min(n + 1, count - 1)) * stride;
      const std::size_t after = start + Index(std::min(n + 2, count - 1)) * stride;
      const float low_here = low_[here];
      const float high_here = high_[here];
      low_[here] = std::min({low_before, low_here, low_[next], low_[after]});
      high_[here] = std::max({high_before, high_here, high_[next], high_[after]});
      low_before = low_here;
      high_before = high_here;
    }
  }

  std::vector<float> low_, high_;
  int width_px_;
};

// Reads a picture between its pixels, on one surface only.
class SurfaceSampler {
 public:
  SurfaceSampler(const model::LinearPicture& picture, const DisparityMap& map)
      : picture_(picture),
        map_(map),
        range_(map),
        tolerance_(kSamePointPx / map.step.cwiseAbs().maxCoeff()) {}

  // The picture at (x, y), cut to the picture, of the surface of that disparity.
  void Sample(double x, double y, float disparity, float* value) const {
    const double inside_x = std::clamp(x, 0.0, picture_.width_px - 1.0);
    const double inside_y = std::clamp(y, 0.0, picture_.height_px - 1.0);
    const int x0 = static_cast<int>(inside_x);
    const int y0 = static_cast<int>(inside_y);
    if (Agrees(range_.low(x0, y0), disparity) && Agrees(range_.high(x0, y0), disparity)) {
      Bicubic(x0, y0, inside_x - x0, inside_y - y0, value);
    } else {
      Bilinear(x0, y0, inside_x - x0, inside_y - y0, disparity, value);
    }
  }

 private:
  bool Agrees(float tap_disparity, float disparity) const {
    return std::abs(static_cast<double>(tap_disparity) - disparity) <= tolerance_;
  }

  const float* Pixel(int x, int y) const {
    return picture_.values.data() +
           (Index(y) * Index(picture_.width_px) + Index(x)) * Index(picture_.channels);
  }

  void Bicubic(int x0, int y0, double fraction_x, double fraction_y, float* value) const {
    const std::array<float, 4> weight_x = CatmullRomWeights(fraction_x);
    const std::array<float, 4> weight_y = CatmullRomWeights(fraction_y);
    const auto channels = Index(picture_.channels);
    std::array<const float*, 4> row;
    std::array<std::size_t, 4> column;
    for (int n = 0; n < 4; ++n) {
      row[Index(n)] = Pixel(0, std::clamp(y0 + n - 1, 0, picture_.height_px - 1));
      column[Index(n)] = Index(std::clamp(x0 + n - 1, 0, picture_.width_px - 1)) * channels;
    }
    for (std::size_t c = 0; c < channels; ++c) {
      float sum = 0;
      for (std::size_t j = 0; j < 4; ++j) {
        const float* of_channel = row[j] + c;
        sum += weight_y[j] *
               (weight_x[0] * of_channel[column[0]] + weight_x[1] * of_channel[column[1]] +
                weight_x[2] * of_channel[column[2]] + weight_x[3] * of_channel[column[3]]);
      }
      value[c] = sum;
    }
  }

  // Of the taps of the surface alone; where none is, the tap nearest to it in disparity.
  void Bilinear(int x0, int y0, double fraction_x, double fraction_y, float disparity,
                float* value) const {
    double sum_of_weights = 0;
    double closest = std::numeric_limits<double>::infinity();
    const float* closest_tap = Pixel(x0, y0);
    std::fill(value, value + picture_.channels, 0.0F);
    for (int j = 0; j < 2; ++j) {
      for (int i = 0; i < 2; ++i) {
        const double weight =
            (i == 0 ? 1 - fraction_x : fraction_x) * (j == 0 ? 1 - fraction_y : fraction_y);
        if (weight == 0) continue;  // perhaps outside of the picture
        const float there = map_.disparity[Index(y0 + j) * Index(map_.width_px) + Index(x0 + i)];
        const float* tap = Pixel(x0 + i, y0 + j);
        const double difference = std::abs(static_cast<double>(there) - disparity);
        if (difference < closest) {
          closest = difference;
          closest_tap = tap;
        }
        if (!Agrees(there, disparity)) continue;
        sum_of_weights += weight;
        for (int c = 0; c < picture_.channels; ++c) value[c] += static_cast<float>(weight) * tap[c];
      }
    }
    for (int c = 0; c < picture_.channels; ++c) {
      value[c] =
          sum_of_weights > 0 ? value[c] / static_cast<float>(sum_of_weights) : closest_tap[c];
    }
  }

  const model::LinearPicture& picture_;
  const DisparityMap& map_;
  const DisparityRange range_;
  const double tolerance_;  // in the unit of the map; infinite where the steps are 0
};

void CheckSameSize(const char* what, int width_px, int height_px, const DisparityMap& map) {
  if (width_px == map.width_px && height_px == map.height_px) return;
  throw Error(fmt::format("{} is {}x{} px, the disparity {}x{} px: the sizes must be equal", what,
                          width_px, height_px, map.width_px, map.height_px));
}

}  // namespace

// disparity * step = -m, m = (1 - d0/(z - zl)) du/ds of model::SlopeOnGrid, and the same in v. The
// disparity is that of a step of 1 mm, in px per mm: (d0/(z - zl) - 1)/ds, both factors negated
// where d0 < 0, so that nearer is always larger.
DisparityMap DisparityOnGrid(const model::LightFieldGrid& grid, const std::vector<float>& depth_mm,
                             int width_px, int height_px) {
  CheckCount("depth map", width_px, height_px, 1, depth_mm.size());
  const double sign = grid.planes.plane_spacing_mm < 0 ? -1 : 1;
  model::LightFieldGrid per_mm = grid;
  per_mm.u_step_mm = sign;

  DisparityMap map;
  map.width_px = width_px;
  map.height_px = height_px;
  map.step = {sign * grid.u_step_mm, sign * grid.v_step_mm * grid.s_step_mm / grid.t_step_mm};
  map.disparity.reserve(depth_mm.size());
  for (const float z_mm : depth_mm) {
    if (std::isnan(z_mm)) {
      map.disparity.push_back(kHole);
      continue;
    }
    if (!(z_mm > grid.planes.uv_depth_mm)) {
      throw Error(
          fmt::format("depth map: a depth is {} mm: every one must be beyond the UV plane, > {} mm",
                      z_mm, grid.planes.uv_depth_mm));
    }
    map.disparity.push_back(static_cast<float>(-model::SlopeOnGrid(per_mm, z_mm)));
  }
  return map;
}

DisparityMap DisparityFromMap(const model::RawDepthMap& map, double scale, double offset_px) {
  CheckCount("disparity map", map.width_px, map.height_px, 1, map.values.size());
  if (!std::isfinite(scale) || scale == 0) {
    throw Error(fmt::format("disparity map: the scale is {}: it must be finite and not 0", scale));
  }
  if (!std::isfinite(offset_px)) {
    throw Error(fmt::format("disparity map: the offset is {} px: it must be finite", offset_px));
  }
  DisparityMap disparity{map.width_px, map.height_px, {}, {1, 1}};
  disparity.disparity.reserve(map.values.size());
  bool all_holes = true;
  for (const float value : map.values) {
    const auto px = static_cast<float>(scale * value + offset_px);
    const bool hole = !std::isfinite(px) || (map.integer && value == 0);
    disparity.disparity.push_back(hole ? kHole : px);
    all_holes = all_holes && hole;
  }
  if (all_holes) {
    throw Error(
        fmt::format("disparity map: all of its {} values are holes{}", map.values.size(),
                    map.integer ? " (0 in an integer map, or not finite)" : " (not finite)"));
  }
  return disparity;
}

DisparityMap FillHoles(const DisparityMap& map, std::size_t* filled) {
  CheckCount("disparity map", map.width_px, map.height_px, 1, map.disparity.size());
  DisparityMap full = map;
  std::size_t holes = 0;
  for (const float value : map.disparity) holes += std::isnan(value) ? 1 : 0;
  if (filled != nullptr) *filled = holes;
  if (holes == map.disparity.size()) {
    throw Error(
        fmt::format("disparity map: all of its {} values are holes: there is nothing to "
                    "fill them from",
                    holes));
  }
  // One known pixel fills its row and its column in the first round, and so all in the second.
  const auto has_holes = [&full] {
    return std::any_of(full.disparity.begin(), full.disparity.end(),
                       [](float value) { return std::isnan(value); });
  };
  while (has_holes()) {
    const FarthestNeighbours neighbours(full);
    for (std::size_t i = 0; i < full.disparity.size(); ++i) {
      if (std::isnan(full.disparity[i])) full.disparity[i] = neighbours.at(i);
    }
  }
  return full;
}

model::LinearPicture WarpPicture(const model::LinearPicture& picture, const DisparityMap& map,
                                 const ViewDisparity& view) {
  CheckCount("picture", picture.width_px, picture.height_px, picture.channels,
             picture.values.size());
  CheckSameSize("the picture", picture.width_px, picture.height_px, map);
  CheckSameSize("the view", view.width_px, view.height_px, map);
  const SurfaceSampler sampler(picture, map);
  model::LinearPicture warped{picture.width_px, picture.height_px, picture.channels, {}};
  warped.values.resize(picture.values.size());
  std::size_t i = 0;
  for (int y = 0; y < picture.height_px; ++y) {
    for (int x = 0; x < picture.width_px; ++x, ++i) {
      sampler.Sample(static_cast<double>(x) + view.source_x[i],
                     static_cast<double>(y) + view.source_y[i], view.disparity[i],
                     warped.values.data() + i * Index(picture.channels));
    }
  }
  return warped;
}

}  // namespace thicklens::estimator
