#include "thicklens/estimator/render.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "estimator/render/shown_views.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"
#include "thicklens/kernels/catmull_rom.h"

namespace thicklens::estimator {
namespace {

// Positions whose difference, relative or in px, is smaller are equal except for rounding.
constexpr double kRounding = 1e-9;
constexpr int kMaxImageSizePx = 100000;  // one way, as for images of files

void CheckIndex(const char* name, int value, int count) {
  if (value >= 0 && value < count) return;
  throw Error(fmt::format("{} is {}: it must be from 0 to {}", name, value, count - 1));
}

// The samples x of [0, count) for which x - shift_px lies inside the view, and how to read there.
struct ShiftedAxis {
  int first = 0, last = -1;
  int whole = 0;                    // sample at 0 of the four taps: x + whole
  std::array<float, 4> tap_weight;  // of the taps at -1, 0, 1, 2

  ShiftedAxis(double shift_px, int count) : tap_weight{} {
    const double source_px = -shift_px;  // for x = 0
    const double nearest_px = std::round(source_px);
    const double snapped_px = std::abs(source_px - nearest_px) < kRounding ? nearest_px : source_px;
    if (!(std::abs(snapped_px) < count)) return;  // all of it is outside
    whole = static_cast<int>(std::floor(snapped_px));
    const std::array<double, 4> weights = kernels::CatmullRomWeights<double>(snapped_px - whole);
    for (std::size_t n = 0; n < weights.size(); ++n) tap_weight[n] = static_cast<float>(weights[n]);
    first = static_cast<int>(std::max(0.0, std::ceil(-snapped_px)));
    last = static_cast<int>(std::min(count - 1.0, std::floor(count - 1 - snapped_px)));
  }

  bool Holds(int x) const { return x >= first && x <= last; }
};

// One view of a refocused image.
struct ShiftedView {
  int k = 0, l = 0;
  double weight = 0;
  ShiftedAxis x, y;
};

// Adds a row of the shifted view to the weighted sums of its samples.
void AddRow(const float* view, int s_count, int t_count, const ShiftedView& shifted, int y,
            std::vector<float>* blended, std::vector<double>* sums) {
  std::fill(blended->begin(), blended->end(), 0.0F);
  for (int tap = 0; tap < 4; ++tap) {
    const int t = std::clamp(y + shifted.y.whole + tap - 1, 0, t_count - 1);
    const float weight = shifted.y.tap_weight[Index(tap)];
    const float* row = view + Index(t) * Index(s_count);
    for (int s = 0; s < s_count; ++s) (*blended)[Index(s)] += weight * row[s];
  }
  for (int x = shifted.x.first; x <= shifted.x.last; ++x) {
    double value = 0;
    for (int tap = 0; tap < 4; ++tap) {
      const int s = std::clamp(x + shifted.x.whole + tap - 1, 0, s_count - 1);
      value += static_cast<double>(shifted.x.tap_weight[Index(tap)]) * (*blended)[Index(s)];
    }
    (*sums)[Index(x)] += shifted.weight * value;
  }
}

// Computes row y of the mean of the shifted views, for all channels.
void RefocusRow(const model::LightField& light_field, const std::vector<ShiftedView>& views, int y,
                model::LinearImage* image) {
  const int width = light_field.s_count;
  std::vector<double> weights(Index(width), 0.0);
  for (const ShiftedView& view : views) {
    if (!view.y.Holds(y)) continue;
    for (int x = view.x.first; x <= view.x.last; ++x) weights[Index(x)] += view.weight;
  }
  std::vector<float> blended(Index(width));
  for (int channel = 0; channel < light_field.channels; ++channel) {
    std::vector<double> sums(Index(width), 0.0);
    for (const ShiftedView& view : views) {
      if (!view.y.Holds(y)) continue;
      AddRow(light_field.values.data() + light_field.ViewStart(channel, view.k, view.l), width,
             light_field.t_count, view, y, &blended, &sums);
    }
    for (int x = 0; x < width; ++x) {
      if (weights[Index(x)] == 0) continue;  // no view reaches here: black
      image->values[(Index(y) * Index(width) + Index(x)) * Index(light_field.channels) +
                    Index(channel)] = static_cast<float>(sums[Index(x)] / weights[Index(x)]);
    }
  }
}

// Copies the channel values of one sample of a view to a pixel.
void CopySample(const model::LightField& light_field, int k, int l, int s, int t, int x, int y,
                model::LinearImage* image) {
  for (int channel = 0; channel < light_field.channels; ++channel) {
    image->values[(Index(y) * Index(image->width_px) + Index(x)) * Index(image->channels) +
                  Index(channel)] =
        light_field.values[light_field.ViewStart(channel, k, l) +
                           Index(t) * Index(light_field.s_count) + Index(s)];
  }
}

// The image has `views` lines, each repeated.
void CheckRepeat(int repeat_px, int views) {
  const int most = std::max(1, kMaxImageSizePx / views);
  if (repeat_px >= 1 && repeat_px <= most) return;
  throw Error(
      fmt::format("repeat_px is {}: it must be from 1 to {} for {} views", repeat_px, most, views));
}

// The largest gap between `views` views, one way, with which a mosaic is not too large. Throws
// Error if it is too large without a gap.
int LargestGapPx(int views, int view_px) {
  const std::int64_t free_px = kMaxImageSizePx - static_cast<std::int64_t>(views) * view_px;
  if (free_px < 0) {
    throw Error(fmt::format("{} views of {} px side by side: they must not exceed {} px", views,
                            view_px, kMaxImageSizePx));
  }
  return static_cast<int>(views > 1 ? free_px / (views - 1) : free_px);
}

void CheckGap(const model::LightField& light_field, int gap_px) {
  const int most = std::min(LargestGapPx(light_field.u_count, light_field.s_count),
                            LargestGapPx(light_field.v_count, light_field.t_count));
  if (gap_px >= 0 && gap_px <= most) return;
  throw Error(fmt::format("gap_px is {}: it must be from 0 to {} for {}x{} views of {}x{} px",
                          gap_px, most, light_field.u_count, light_field.v_count,
                          light_field.s_count, light_field.t_count));
}

}  // namespace

model::LinearImage Refocus(const model::LightField& light_field, double disparity_u_px,
                           double disparity_v_px, const Eigen::ArrayXXd& weights, int threads) {
  CheckLightField(light_field);
  if (!std::isfinite(disparity_u_px) || !std::isfinite(disparity_v_px)) {
    throw Error(fmt::format("disparity is ({}, {}) px per view step: both must be finite",
                            disparity_u_px, disparity_v_px));
  }
  const Eigen::ArrayXXd present = PresentWeights(light_field, weights);
  std::vector<ShiftedView> views;
  for (int l = 0; l < light_field.v_count; ++l) {
    for (int k = 0; k < light_field.u_count; ++k) {
      if (present(l, k) == 0) continue;
      views.push_back({k, l, present(l, k),
                       ShiftedAxis(light_field.u_offset(k) * disparity_u_px, light_field.s_count),
                       ShiftedAxis(light_field.v_offset(l) * disparity_v_px, light_field.t_count)});
    }
  }
  model::LinearImage image =
      BlackImage(light_field.s_count, light_field.t_count, light_field.channels);
  ParallelFor(light_field.t_count, threads,
              [&](int y) { RefocusRow(light_field, views, y, &image); });
  return image;
}

// d = -m. SlopeOnGrid returns m in u; for a grid with exchanged axes it returns m in v.
Eigen::Vector2d DisparityAtDepthPx(const model::LightField& light_field, double depth_mm) {
  if (!light_field.grid) {
    throw Error(fmt::format(
        "depth {} mm: this light field has no camera; state a disparity instead of a depth",
        depth_mm));
  }
  model::LightFieldGrid exchanged = *light_field.grid;
  std::swap(exchanged.s_step_mm, exchanged.t_step_mm);
  std::swap(exchanged.u_step_mm, exchanged.v_step_mm);
  return {-model::SlopeOnGrid(*light_field.grid, depth_mm),
          -model::SlopeOnGrid(exchanged, depth_mm)};
}

model::LinearImage Mosaic(const model::LightField& light_field, int gap_px) {
  CheckLightField(light_field);
  CheckGap(light_field, gap_px);
  const int step_x = light_field.s_count + gap_px;
  const int step_y = light_field.t_count + gap_px;
  model::LinearImage mosaic =
      BlackImage(light_field.u_count * step_x - gap_px, light_field.v_count * step_y - gap_px,
                 light_field.channels);
  for (int l = 0; l < light_field.v_count; ++l) {
    for (int k = 0; k < light_field.u_count; ++k) {
      for (int t = 0; t < light_field.t_count; ++t) {
        for (int s = 0; s < light_field.s_count; ++s) {
          CopySample(light_field, k, l, s, t, k * step_x + s, l * step_y + t, &mosaic);
        }
      }
    }
  }
  return mosaic;
}

model::LinearImage EpipolarRow(const model::LightField& light_field, int t, int l, int repeat_px) {
  CheckLightField(light_field);
  CheckIndex("row t", t, light_field.t_count);
  CheckIndex("view row l", l, light_field.v_count);
  CheckRepeat(repeat_px, light_field.u_count);
  model::LinearImage image =
      BlackImage(light_field.s_count, light_field.u_count * repeat_px, light_field.channels);
  for (int y = 0; y < image.height_px; ++y) {
    ThrowIfCancelled();
    for (int s = 0; s < light_field.s_count; ++s) {
      CopySample(light_field, y / repeat_px, l, s, t, s, y, &image);
    }
  }
  return image;
}

model::LinearImage EpipolarColumn(const model::LightField& light_field, int s, int k,
                                  int repeat_px) {
  CheckLightField(light_field);
  CheckIndex("column s", s, light_field.s_count);
  CheckIndex("view column k", k, light_field.u_count);
  CheckRepeat(repeat_px, light_field.v_count);
  model::LinearImage image =
      BlackImage(light_field.v_count * repeat_px, light_field.t_count, light_field.channels);
  for (int t = 0; t < light_field.t_count; ++t) {
    for (int x = 0; x < image.width_px; ++x) {
      CopySample(light_field, k, x / repeat_px, s, t, x, t, &image);
    }
  }
  return image;
}

}  // namespace thicklens::estimator
