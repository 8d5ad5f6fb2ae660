#include "thicklens/kernels/row_warper.h"

#include <algorithm>
#include <limits>

#include "kernels/cpu/processor.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"

namespace thicklens::kernels {
namespace {

// Repeated pixels before the first and after the last pixel of a row or a column: a sample reads
// the pixels at -1, 0, 1 and 2.
constexpr int kBefore = 1;
constexpr int kAfter = 2;

std::size_t Stride(int width_px) { return Index(width_px + kBefore + kAfter); }

// Number of channels of a pixel that are read at once if the image has more than one.
constexpr int kFour = 4;
int ChannelsOfPixel(int channels) { return channels == 1 ? 1 : kFour; }

using Four = float __attribute__((vector_size(kFour * sizeof(float))));
inline __attribute__((always_inline)) Four Load(const float* from) {
  Four four;
  __builtin_memcpy(&four, from, sizeof four);
  return four;
}

// The weights of catmull_rom.h, all four at once; a weight that is 0 may have another sign.
inline __attribute__((always_inline)) Four CatmullRom(float fraction) {
  constexpr Four kCubic{-0.5F, 1.5F, -1.5F, 0.5F};
  constexpr Four kSquare{1, -2.5F, 2, -0.5F};
  constexpr Four kLinear{-0.5F, 0, 0.5F, 0};
  constexpr Four kConstant{0, 1, 0, 0};
  return ((kCubic * fraction + kSquare) * fraction + kLinear) * fraction + kConstant;
}

// Sums four taps below each other, `stride` numbers apart.
inline __attribute__((always_inline)) Four Down(const float* tap, std::size_t stride,
                                                const Four& weight) {
  return weight[0] * Load(tap) + weight[1] * Load(tap + stride) +
         weight[2] * Load(tap + 2 * stride) + weight[3] * Load(tap + 3 * stride);
}

// Sums the 16 taps from `tap` on, of pixels with four channels. The order of the sum is that of
// pixels with one channel, so that each channel gets the same bits as alone (where the compiler
// fuses no sums with products).
inline __attribute__((always_inline)) Four BicubicOfFour(const float* tap, std::size_t stride,
                                                         const Four& weight_x,
                                                         const Four& weight_y) {
  return (weight_x[0] * Down(tap, stride, weight_y) +
          weight_x[1] * Down(tap + kFour, stride, weight_y)) +
         (weight_x[2] * Down(tap + 2 * kFour, stride, weight_y) +
          weight_x[3] * Down(tap + 3 * kFour, stride, weight_y));
}

inline __attribute__((always_inline)) float BicubicOfOne(const float* tap, std::size_t stride,
                                                         const Four& weight_x,
                                                         const Four& weight_y) {
  const Four terms = weight_x * Down(tap, stride, weight_y);
  return (terms[0] + terms[1]) + (terms[2] + terms[3]);
}

// Splits the positions of sources along one axis into the pixel before each (clamped to 0 to
// `last`) and the rest. The source of sample n is at origin + n step + source[n]. `limit_px` must
// exceed the width and the height of the image.
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

RowWarper::Places::Places(int width_px)
    : x(Index(width_px)),
      y(Index(width_px)),
      fraction_x(Index(width_px)),
      fraction_y(Index(width_px)) {}

RowWarper::RowWarper(const SurfaceImage& image)
    : width_px_(image.width_px),
      height_px_(image.height_px),
      channels_(image.channels),
      tolerance_(image.tolerance),
      disparity_(*image.disparity) {
  CopyPixels(*image.values);
  FindRanges();
}

void RowWarper::CopyPixels(const std::vector<float>& values) {
  const int width = width_px_;
  const int height = height_px_;
  const int of_pixel = ChannelsOfPixel(channels_);
  const int planes = (channels_ + of_pixel - 1) / of_pixel;
  pixels_.resize(Stride(width) * Stride(height) * Index(of_pixel) * Index(planes));
  float* to = pixels_.data();
  for (int plane = 0; plane < planes; ++plane) {
    const int first = plane * of_pixel;
    const int count = std::min(of_pixel, channels_ - first);
    for (int y = -kBefore; y < height + kAfter; ++y) {
      ThrowIfCancelled();
      const float* const row =
          values.data() + Index(std::clamp(y, 0, height - 1)) * Index(width) * Index(channels_) +
          first;
      for (int x = -kBefore; x < width + kAfter; ++x, to += of_pixel) {
        std::copy_n(row + Index(std::clamp(x, 0, width - 1)) * Index(channels_), count, to);
      }
    }
  }
}

void RowWarper::FindRanges() {
  const int width = width_px_;
  const int height = height_px_;
  ranges_.resize(disparity_.size());
  // Range of the four pixels in each column.
  std::vector<Range> columns(Index(width));
  const auto row_of = [&](int y) {
    return disparity_.data() + Index(std::clamp(y, 0, height - 1)) * Index(width);
  };
  for (int y = 0; y < height; ++y) {
    ThrowIfCancelled();
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

// Returns the address of the pixel's first channel.
const float* RowWarper::Tap(int x, int y) const {
  return pixels_.data() + (Index(y + kBefore) * Stride(width_px_) + Index(x + kBefore)) *
                              Index(ChannelsOfPixel(channels_));
}

// This loop is inlined into its caller, which selects the processor's vector instructions.
// kChannels: 0 for any number.
template <int kChannels>
inline __attribute__((always_inline)) void RowWarper::WarpRowOf(const Places& places,
                                                                const float* disparities,
                                                                float* warped) const {
  const int channels = kChannels > 0 ? kChannels : channels_;
  const std::size_t stride = Stride(width_px_) * Index(kChannels == 1 ? 1 : kFour);
  const std::size_t plane = stride * Stride(height_px_);
  for (int n = 0; n < width_px_; ++n, warped += channels) {
    const std::size_t i = Index(n);
    const int x0 = places.x[i];
    const int y0 = places.y[i];
    const float disparity = disparities[i];
    const Range& range = ranges_[Index(y0) * Index(width_px_) + Index(x0)];
    if (!Agrees(range.lowest, disparity) || !Agrees(range.highest, disparity)) {
      Bilinear(x0, y0, places.fraction_x[i], places.fraction_y[i], disparity, warped);
      continue;
    }
    const Four weight_x = CatmullRom(places.fraction_x[i]);
    const Four weight_y = CatmullRom(places.fraction_y[i]);
    const float* tap = Tap(x0 - 1, y0 - 1);
    if (kChannels == 1) {
      *warped = BicubicOfOne(tap, stride, weight_x, weight_y);
      continue;
    }
    for (int first = 0; first < channels; first += kFour, tap += plane) {
      const Four values = BicubicOfFour(tap, stride, weight_x, weight_y);
      for (int c = 0; c < std::min(kFour, channels - first); ++c) warped[first + c] = values[c];
    }
  }
}

#if defined(__x86_64__)

template <int kChannels>
__attribute__((target("avx2"))) void RowWarper::WarpRowAvx2(const Places& places,
                                                            const float* disparities,
                                                            float* warped) const {
  WarpRowOf<kChannels>(places, disparities, warped);
}

#endif

template <int kChannels>
void RowWarper::WarpRow(const Places& places, const float* disparities, float* warped) const {
#if defined(__x86_64__)
  // FMA is not enabled because it would round sums of one channel and of four differently.
  if (HasAvx2()) return WarpRowAvx2<kChannels>(places, disparities, warped);
#endif
  WarpRowOf<kChannels>(places, disparities, warped);
}

void RowWarper::Warp(int y, const float* disparity, const float* source_x, const float* source_y,
                     Places* places, float* warped) const {
  const auto limit_px = static_cast<float>(width_px_ + height_px_);
  SplitSources(source_x, width_px_, 0, 1, width_px_ - 1, limit_px, places->x.data(),
               places->fraction_x.data());
  SplitSources(source_y, width_px_, y, 0, height_px_ - 1, limit_px, places->y.data(),
               places->fraction_y.data());
  if (channels_ == 3) {
    WarpRow<3>(*places, disparity, warped);
  } else if (channels_ == 1) {
    WarpRow<1>(*places, disparity, warped);
  } else {
    WarpRow<0>(*places, disparity, warped);
  }
}

// Interpolates the taps of the surface alone; if there is none, the tap nearest in disparity is
// used.
void RowWarper::Bilinear(int x0, int y0, float fraction_x, float fraction_y, float disparity,
                         float* value) const {
  const int of_pixel = ChannelsOfPixel(channels_);
  const std::size_t plane = Stride(width_px_) * Stride(height_px_) * Index(of_pixel);
  const auto channel = [&](const float* tap, int c) {
    return tap[Index(c / of_pixel) * plane + Index(c % of_pixel)];
  };
  double sum_of_weights = 0;
  double closest = std::numeric_limits<double>::infinity();
  const float* closest_tap = Tap(x0, y0);
  std::fill(value, value + channels_, 0.0F);
  for (int j = 0; j < 2; ++j) {
    for (int i = 0; i < 2; ++i) {
      const double weight = (i == 0 ? 1 - static_cast<double>(fraction_x) : fraction_x) *
                            (j == 0 ? 1 - static_cast<double>(fraction_y) : fraction_y);
      if (weight == 0) continue;  // the tap may be outside of the image
      const float there = disparity_[Index(y0 + j) * Index(width_px_) + Index(x0 + i)];
      const float* const tap = Tap(x0 + i, y0 + j);
      const double difference = std::abs(static_cast<double>(there) - disparity);
      if (difference < closest) {
        closest = difference;
        closest_tap = tap;
      }
      if (!Agrees(there, disparity)) continue;
      sum_of_weights += weight;
      for (int c = 0; c < channels_; ++c) {
        value[c] += static_cast<float>(weight) * channel(tap, c);
      }
    }
  }
  for (int c = 0; c < channels_; ++c) {
    value[c] = sum_of_weights > 0 ? value[c] / static_cast<float>(sum_of_weights)
                                  : channel(closest_tap, c);
  }
}

void RowWarper::Mix(const std::vector<BoundarySample>& mixed, float* warped) const {
  const auto limit_px = static_cast<float>(width_px_ + height_px_);
  std::vector<float> value(Index(channels_));
  for (const BoundarySample& sample : mixed) {
    const int x = sample.index % width_px_, y = sample.index / width_px_;
    std::int32_t x0 = 0, y0 = 0;
    float fx = 0, fy = 0;
    SplitSources(&sample.other.source_x, 1, x, 1, width_px_ - 1, limit_px, &x0, &fx);
    SplitSources(&sample.other.source_y, 1, y, 0, height_px_ - 1, limit_px, &y0, &fy);
    Bilinear(x0, y0, fx, fy, sample.other.disparity, value.data());
    float* const to = warped + Index(sample.index) * Index(channels_);
    for (int c = 0; c < channels_; ++c) to[c] += sample.share * (value[Index(c)] - to[c]);
  }
}

}  // namespace thicklens::kernels
