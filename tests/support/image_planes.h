#ifndef THICKLENS_TESTS_SUPPORT_IMAGE_PLANES_H_
#define THICKLENS_TESTS_SUPPORT_IMAGE_PLANES_H_

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "thicklens/kernels/image_filter.h"

namespace thicklens::testing {

// Planes with gaps between them, which contain another value.
template <typename Real>
struct Planes {
  int width_px, height_px, channels;
  std::ptrdiff_t stride;
  std::vector<Real> values;

  Planes(int width, int height, int channel_count, Real between)
      : width_px(width),
        height_px(height),
        channels(channel_count),
        stride(std::ptrdiff_t{width} * height + 5),
        values(static_cast<std::size_t>(stride) * static_cast<std::size_t>(channel_count),
               between) {}

  Real& at(int c, int x, int y) { return at(c, y * width_px + x); }
  Real at(int c, int x, int y) const { return at(c, y * width_px + x); }
  Real& at(int c, int pixel) { return values[static_cast<std::size_t>(c * stride + pixel)]; }
  Real at(int c, int pixel) const { return values[static_cast<std::size_t>(c * stride + pixel)]; }
  kernels::ImageIn<Real> in() const { return {values.data(), stride, channels}; }
  kernels::ImageOut<Real> out() { return {values.data(), stride, channels}; }
  int pixels() const { return width_px * height_px; }
};

// The gaps contain NaN, which would spread to whatever is computed from it.
template <typename Real>
Planes<Real> RandomPlanes(int width, int height, int channels, std::uint32_t seed) {
  Planes<Real> planes(width, height, channels, std::numeric_limits<Real>::quiet_NaN());
  std::mt19937 random(seed);
  std::uniform_real_distribution<Real> value(-1, 1);
  for (int c = 0; c < channels; ++c) {
    for (int p = 0; p < planes.pixels(); ++p) planes.at(c, p) = value(random);
  }
  return planes;
}

constexpr float kUntouched = 1234;

template <typename Real>
void ExpectOutsideUntouched(const Planes<Real>& y) {
  for (int c = 0; c < y.channels; ++c) {
    for (int p = y.pixels(); p < y.stride; ++p) {
      ASSERT_EQ(y.at(c, p), static_cast<Real>(kUntouched))
          << "channel " << c << " behind the plane";
    }
  }
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_IMAGE_PLANES_H_
