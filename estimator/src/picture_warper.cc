// PictureWarper: a picture seen from other views.
#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "thicklens/error.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {
namespace {

// A pixel whose disparity differs by more, px per view step, is not of the sample's surface.
constexpr double kSamePointPx = 0.3;

// Repeated pixels before the first and after the last pixel of a row or a column: a sample reads
// those at -1, 0, 1 and 2.
constexpr int kBefore = 1;
constexpr int kAfter = 2;

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

std::size_t Stride(int width_px) { return Index(width_px + kBefore + kAfter); }

void CheckPicture(const model::LinearPicture& picture) {
  if (picture.width_px < 1 || picture.height_px < 1 || picture.channels < 1 ||
      picture.values.size() !=
          Index(picture.width_px) * Index(picture.height_px) * Index(picture.channels)) {
    throw Error(
        fmt::format("picture: {} values for {}x{} px in {} channels: the count must be the "
                    "product, and not 0",
                    picture.values.size(), picture.width_px, picture.height_px, picture.channels));
  }
}

void CheckSameSize(const char* what, int width_px, int height_px, const DisparityMap& map) {
  if (width_px == map.width_px && height_px == map.height_px) return;
  throw Error(fmt::format("{} is {}x{} px, the disparity {}x{} px: the sizes must be equal", what,
                          width_px, height_px, map.width_px, map.height_px));
}

// The weights of catmull_rom.h, in float and the four at once.
EIGEN_ALWAYS_INLINE Eigen::Array4f CatmullRom(float fraction) {
  const Eigen::Array4f cubic(-0.5F, 1.5F, -1.5F, 0.5F);
  const Eigen::Array4f square(1, -2.5F, 2, -0.5F);
  const Eigen::Array4f linear(-0.5F, 0, 0.5F, 0);
  const Eigen::Array4f constant(0, 1, 0, 0);
  return ((cubic * fraction + square) * fraction + linear) * fraction + constant;
}

// Sources along one axis, cut to the pixels 0 to `last`: the pixel before and the rest. The source
// of sample n is at origin + n step + source[n]. `limit_px`: more than the picture is wide and
// high.
void SplitSources(const float* source, int count, std::int32_t origin, std::int32_t step,
                  std::int32_t last, float limit_px, std::int32_t* __restrict pixel,
                  float* __restrict rest) {
  for (std::int32_t n = 0; n < count; ++n) {
    const float not_before = source[n] > -limit_px ? source[n] : -limit_px;
    const float way = not_before < limit_px ? not_before : limit_px;
    const auto toward_zero = static_cast<std::int32_t>(way);
    const std::int32_t below = toward_zero - (static_cast<float>(toward_zero) > way ? 1 : 0);
    const float rest_of_way = way - static_cast<float>(below);
    const std::int32_t at = origin + n * step + below;
    const std::int32_t at_first = at < 0 ? 0 : at;
    pixel[n] = at_first < last ? at_first : last;
    rest[n] = at == pixel[n] && at < last ? rest_of_way : 0.0F;
  }
}

}  // namespace

struct PictureWarper::TapRow {
  explicit TapRow(int count)
      : x(Index(count)), y(Index(count)), fraction_x(Index(count)), fraction_y(Index(count)) {}

  std::vector<std::int32_t> x, y;
  std::vector<float> fraction_x, fraction_y;
};

PictureWarper::PictureWarper(const model::LinearPicture& picture, const DisparityMap& map)
    : map_(map),
      channels_(picture.channels),
      tolerance_(kSamePointPx / map.step.cwiseAbs().maxCoeff()) {
  CheckPicture(picture);
  CheckSameSize("the picture", picture.width_px, picture.height_px, map);
  CopyPlanes(picture);
  FindRanges();
}

void PictureWarper::CopyPlanes(const model::LinearPicture& picture) {
  const int width = picture.width_px;
  const int height = picture.height_px;
  planes_.resize(Stride(width) * Stride(height) * Index(channels_));
  float* to = planes_.data();
  for (int c = 0; c < channels_; ++c) {
    for (int y = -kBefore; y < height + kAfter; ++y) {
      const float* const row =
          picture.values.data() +
          Index(std::clamp(y, 0, height - 1)) * Index(width) * Index(channels_) + c;
      for (int x = -kBefore; x < width + kAfter; ++x) {
        *to++ = row[Index(std::clamp(x, 0, width - 1)) * Index(channels_)];
      }
    }
  }
}

void PictureWarper::FindRanges() {
  const int width = map_.width_px;
  const int height = map_.height_px;
  ranges_.resize(map_.disparity.size());
  // Of the four pixels in each column.
  std::vector<Range> columns(Index(width));
  const auto row_of = [&](int y) {
    return map_.disparity.data() + Index(std::clamp(y, 0, height - 1)) * Index(width);
  };
  for (int y = 0; y < height; ++y) {
    const float* const rows[] = {row_of(y - 1), row_of(y), row_of(y + 1), row_of(y + 2)};
    for (std::size_t x = 0; x < Index(width); ++x) {
      columns[x] = {std::min({rows[0][x], rows[1][x], rows[2][x], rows[3][x]}),
                    std::max({rows[0][x], rows[1][x], rows[2][x], rows[3][x]})};
    }
    for (int x = 0; x < width; ++x) {
      Range& range = ranges_[Index(y) * Index(width) + Index(x)];
      range = columns[Index(x)];
      for (const int n :
           {std::max(x - 1, 0), std::min(x + 1, width - 1), std::min(x + 2, width - 1)}) {
        range.lowest = std::min(range.lowest, columns[Index(n)].lowest);
        range.highest = std::max(range.highest, columns[Index(n)].highest);
      }
    }
  }
}

bool PictureWarper::Agrees(float tap_disparity, float disparity) const {
  return std::abs(static_cast<double>(tap_disparity) - disparity) <= tolerance_;
}

// Of the first channel.
const float* PictureWarper::Tap(int x, int y) const {
  return planes_.data() + Index(y + kBefore) * Stride(map_.width_px) + Index(x + kBefore);
}

template <int kChannels>
void PictureWarper::WarpRow(const TapRow& taps, const float* disparity, float* warped) const {
  const int channels = kChannels > 0 ? kChannels : channels_;
  const std::size_t stride = Stride(map_.width_px);
  const std::size_t plane = stride * Stride(map_.height_px);
  for (int n = 0; n < map_.width_px; ++n, warped += channels) {
    const std::size_t i = Index(n);
    const int x0 = taps.x[i];
    const int y0 = taps.y[i];
    const Range& range = ranges_[Index(y0) * Index(map_.width_px) + Index(x0)];
    if (!Agrees(range.lowest, disparity[i]) || !Agrees(range.highest, disparity[i])) {
      Bilinear(x0, y0, taps.fraction_x[i], taps.fraction_y[i], disparity[i], warped);
      continue;
    }
    using FourOfRow = Eigen::Map<const Eigen::Array4f>;
    const Eigen::Array4f weight_x = CatmullRom(taps.fraction_x[i]);
    const Eigen::Array4f weight_y = CatmullRom(taps.fraction_y[i]);
    const float* tap = Tap(x0 - 1, y0 - 1);
    for (int c = 0; c < channels; ++c, tap += plane) {
      const Eigen::Array4f down =
          weight_y[0] * FourOfRow(tap) + weight_y[1] * FourOfRow(tap + stride) +
          weight_y[2] * FourOfRow(tap + 2 * stride) + weight_y[3] * FourOfRow(tap + 3 * stride);
      warped[c] = (weight_x * down).sum();
    }
  }
}

// Of the taps of the surface alone; where none is, the tap nearest to it in disparity.
void PictureWarper::Bilinear(int x0, int y0, float fraction_x, float fraction_y, float disparity,
                             float* value) const {
  const std::size_t plane = Stride(map_.width_px) * Stride(map_.height_px);
  double sum_of_weights = 0;
  double closest = std::numeric_limits<double>::infinity();
  const float* closest_tap = Tap(x0, y0);
  std::fill(value, value + channels_, 0.0F);
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      const double weight = (i == 0 ? 1 - static_cast<double>(fraction_x) : fraction_x) *
                            (j == 0 ? 1 - static_cast<double>(fraction_y) : fraction_y);
      if (weight == 0) continue;  // perhaps outside of the picture
      const float there = map_.disparity[Index(y0 + j) * Index(map_.width_px) + Index(x0 + i)];
      const float* const tap = Tap(x0 + i, y0 + j);
      const double difference = std::abs(static_cast<double>(there) - disparity);
      if (difference < closest) {
        closest = difference;
        closest_tap = tap;
      }
      if (!Agrees(there, disparity)) continue;
      sum_of_weights += weight;
      for (int c = 0; c < channels_; ++c) {
        value[c] += static_cast<float>(weight) * tap[Index(c) * plane];
      }
    }
  }
  for (int c = 0; c < channels_; ++c) {
    value[c] = sum_of_weights > 0 ? value[c] / static_cast<float>(sum_of_weights)
                                  : closest_tap[Index(c) * plane];
  }
}

model::LinearPicture PictureWarper::Warp(const ViewDisparity& view) const {
  CheckSameSize("the view", view.width_px, view.height_px, map_);
  const int width = map_.width_px;
  model::LinearPicture warped{width, map_.height_px, channels_, {}};
  warped.values.resize(map_.disparity.size() * Index(channels_));
  const auto limit_px = static_cast<float>(width + map_.height_px);
  TapRow taps(width);
  for (int y = 0; y < map_.height_px; ++y) {
    const std::size_t row = Index(y) * Index(width);
    SplitSources(view.source_x.data() + row, width, 0, 1, width - 1, limit_px, taps.x.data(),
                 taps.fraction_x.data());
    SplitSources(view.source_y.data() + row, width, y, 0, map_.height_px - 1, limit_px,
                 taps.y.data(), taps.fraction_y.data());
    const float* const disparity = view.disparity.data() + row;
    float* const values = warped.values.data() + row * Index(channels_);
    if (channels_ == 3) {
      WarpRow<3>(taps, disparity, values);
    } else if (channels_ == 1) {
      WarpRow<1>(taps, disparity, values);
    } else {
      WarpRow<0>(taps, disparity, values);
    }
  }
  return warped;
}

model::LinearPicture WarpPicture(const model::LinearPicture& picture, const DisparityMap& map,
                                 const ViewDisparity& view) {
  return PictureWarper(picture, map).Warp(view);
}

}  // namespace thicklens::estimator
