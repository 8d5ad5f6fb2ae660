#include "thicklens/kernels/image_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "support/error_message.h"
#include "support/image_planes.h"

namespace thicklens::kernels {
namespace {

using ::thicklens::testing::ErrorOf;
using ::thicklens::testing::ExpectOutsideUntouched;
using ::thicklens::testing::kUntouched;
using ::thicklens::testing::Planes;
using ::thicklens::testing::RandomPlanes;

std::size_t Index(std::int64_t i) { return static_cast<std::size_t>(i); }

// Makes a filter whose radii are a mixture of 0 to 11, and one that is larger than most of the
// images.
template <typename Real>
VaryingFilter<Real> RandomFilter(Axis axis, int width, int height, std::uint32_t seed) {
  VaryingFilter<Real> filter;
  filter.axis = axis;
  filter.width_px = width;
  filter.height_px = height;
  filter.start = std::vector<std::size_t>{0};
  std::mt19937 random(seed);
  std::uniform_real_distribution<Real> value(-1, 1);
  for (int y = 0; y < height; ++y) {
    for (int b = 0; b < filter.blocks_in_row(); ++b) {
      const int radius = random() % 9 == 0 ? 70 : static_cast<int>(random() % 12);
      filter.radius_px.push_back(radius);
      for (int n = -radius; n <= radius; ++n) {
        for (int i = 0; i < kFilterBlockPx; ++i) {
          const int x = b * kFilterBlockPx + i;
          const int from = (axis == Axis::kAcross ? x : y) + n;
          const bool inside =
              x < width && from >= 0 && from < (axis == Axis::kAcross ? width : height);
          filter.coefficients.push_back(inside ? value(random) : Real{0});
        }
      }
      filter.start.push_back(filter.coefficients.size());
    }
  }
  return filter;
}

// Calls entry(p, q, c_n(p)) for the pixel numbers p and q = p + n e that are inside.
template <typename Real, typename Entry>
void ForEachCoefficient(const VaryingFilter<Real>& filter, const Entry& entry) {
  for (int y = 0; y < filter.height_px; ++y) {
    for (int x = 0; x < filter.width_px; ++x) {
      const std::size_t block = Index(y * filter.blocks_in_row() + x / kFilterBlockPx);
      const int radius = filter.radius_px[block];
      for (int n = -radius; n <= radius; ++n) {
        const int to_x = filter.axis == Axis::kAcross ? x + n : x;
        const int to_y = filter.axis == Axis::kAcross ? y : y + n;
        if (to_x < 0 || to_x >= filter.width_px || to_y < 0 || to_y >= filter.height_px) continue;
        const std::size_t at = filter.start[block] + Index(n + radius) * Index(kFilterBlockPx) +
                               Index(x % kFilterBlockPx);
        entry(y * filter.width_px + x, to_y * filter.width_px + to_x,
              static_cast<double>(filter.coefficients[at]));
      }
    }
  }
}

template <typename Real>
std::vector<double> PlainApply(const VaryingFilter<Real>& filter, bool transposed,
                               const Planes<Real>& x, int channel) {
  std::vector<double> y(Index(x.pixels()), 0.0);
  ForEachCoefficient(filter, [&](int p, int q, double value) {
    if (transposed) std::swap(p, q);
    y[Index(p)] += value * static_cast<double>(x.at(channel, q));
  });
  return y;
}

struct Size {
  int width, height;
};
const std::vector<Size>& Sizes() {
  static const std::vector<Size> sizes = {{1, 1},  {1, 5},  {63, 1},  {63, 5},  {64, 1}, {64, 5},
                                          {65, 5}, {65, 1}, {130, 5}, {300, 3}, {9, 90}};
  return sizes;
}

template <typename Real>
class ImageFilterTest : public ::testing::Test {
 protected:
  // The tolerance is that of sums of some hundred numbers below 1.
  static constexpr double kTolerance = sizeof(Real) == sizeof(float) ? 2e-5 : 1e-13;
};
using Reals = ::testing::Types<float, double>;
TYPED_TEST_SUITE(ImageFilterTest, Reals);

TYPED_TEST(ImageFilterTest, FiltersLikeThePlainSum) {
  std::uint32_t seed = 0;
  for (const Size size : Sizes()) {
    for (const Axis axis : {Axis::kAcross, Axis::kDown}) {
      for (const int channels : {1, 2, 3, 4, 5}) {
        const auto filter = RandomFilter<TypeParam>(axis, size.width, size.height, ++seed);
        Check(filter);
        const auto x = RandomPlanes<TypeParam>(size.width, size.height, channels, ++seed);
        for (const bool transposed : {false, true}) {
          Planes<TypeParam> y(size.width, size.height, channels, kUntouched);
          transposed ? ApplyTransposed(filter, x.in(), y.out(), 2)
                     : Apply(filter, x.in(), y.out(), 2);
          for (int c = 0; c < channels; ++c) {
            const std::vector<double> plain = PlainApply(filter, transposed, x, c);
            for (int p = 0; p < x.pixels(); ++p) {
              ASSERT_NEAR(y.at(c, p), plain[Index(p)], this->kTolerance)
                  << size.width << "x" << size.height
                  << (axis == Axis::kAcross ? " across" : " down")
                  << (transposed ? " transposed" : "") << ", channel " << c << ", pixel " << p;
            }
          }
          ExpectOutsideUntouched(y);
        }
      }
    }
  }
}

// Values outside the image have no coefficient. They must have no influence even if they are NaN,
// for example because they were left by another row or block.
TYPED_TEST(ImageFilterTest, WhatIsNotANumberStaysInItsBundle) {
  for (const Size size : {Size{130, 60}, Size{64, 5}, Size{37, 30}}) {
    for (const Axis axis : {Axis::kAcross, Axis::kDown}) {
      const auto filter = RandomFilter<TypeParam>(axis, size.width, size.height, 21);
      auto x = RandomPlanes<TypeParam>(size.width, size.height, 1, 22);
      const int w = size.width;
      const std::vector<int> columns = {0, 5, w / 2, w / 2 + 6, w - 6, w - 1};
      for (int y = 0; y < size.height; ++y) {
        x.at(0, columns[Index(y) % columns.size()], y) =
            std::numeric_limits<TypeParam>::quiet_NaN();
      }
      for (const bool transposed : {false, true}) {
        Planes<TypeParam> y(size.width, size.height, 1, kUntouched);
        transposed ? ApplyTransposed(filter, x.in(), y.out(), 1)
                   : Apply(filter, x.in(), y.out(), 1);
        const std::vector<double> plain = PlainApply(filter, transposed, x, 0);
        for (int p = 0; p < x.pixels(); ++p) {
          ASSERT_EQ(std::isnan(y.at(0, p)), std::isnan(plain[Index(p)]))
              << size.width << "x" << size.height << (axis == Axis::kAcross ? " across" : " down")
              << (transposed ? " transposed" : "") << ", pixel " << p;
        }
      }
    }
  }
}

// <F x, y> = <x, F^T y>.
TYPED_TEST(ImageFilterTest, TransposedIsTheAdjoint) {
  for (const Axis axis : {Axis::kAcross, Axis::kDown}) {
    const auto filter = RandomFilter<TypeParam>(axis, 130, 40, 7);
    const auto x = RandomPlanes<TypeParam>(130, 40, 3, 8),
               y = RandomPlanes<TypeParam>(130, 40, 3, 9);
    Planes<TypeParam> f_x(130, 40, 3, 0), ft_y(130, 40, 3, 0);
    Apply(filter, x.in(), f_x.out(), 2);
    ApplyTransposed(filter, y.in(), ft_y.out(), 2);
    double left = 0, right = 0, size = 0;
    for (int c = 0; c < 3; ++c) {
      for (int p = 0; p < x.pixels(); ++p) {
        const double term = static_cast<double>(f_x.at(c, p)) * static_cast<double>(y.at(c, p));
        left += term;
        size += std::abs(term);
        right += static_cast<double>(x.at(c, p)) * static_cast<double>(ft_y.at(c, p));
      }
    }
    EXPECT_NEAR(left, right, (sizeof(TypeParam) == sizeof(float) ? 1e-6 : 1e-14) * size);
    EXPECT_GT(std::abs(left), 1e-4 * size);
  }
}

// A filter whose coefficients are 1 in one block shifts every pixel of that block, and no other.
TYPED_TEST(ImageFilterTest, ShiftsBlocksByHand) {
  VaryingFilter<TypeParam> filter;
  filter.width_px = 128;
  filter.height_px = 1;
  filter.radius_px = std::vector<std::int32_t>{0, 2};
  filter.start = std::vector<std::size_t>{0, 64, 6 * 64};
  filter.coefficients.assign(6 * 64, 0);
  std::fill_n(filter.coefficients.begin(), 64, TypeParam{1});
  std::fill_n(filter.coefficients.begin() + 64, 64, TypeParam{2});  // n = -2
  Check(filter);
  Planes<TypeParam> x(128, 1, 1, 0), y(128, 1, 1, 0);
  for (int p = 0; p < 128; ++p) x.at(0, p) = static_cast<TypeParam>(p + 1);
  Apply(filter, x.in(), y.out(), 1);
  EXPECT_EQ(y.at(0, 0), 1);
  EXPECT_EQ(y.at(0, 63), 64);
  EXPECT_EQ(y.at(0, 64), 2 * 63);
  EXPECT_EQ(y.at(0, 127), 2 * 126);
  ApplyTransposed(filter, x.in(), y.out(), 1);
  EXPECT_EQ(y.at(0, 61), 62);
  EXPECT_EQ(y.at(0, 62), 63 + 2 * 65);
  EXPECT_EQ(y.at(0, 63), 64 + 2 * 66);
  EXPECT_EQ(y.at(0, 64), 2 * 67);
  EXPECT_EQ(y.at(0, 125), 2 * 128);
  EXPECT_EQ(y.at(0, 126), 0);
}

template <typename Real>
std::vector<Real> AllResults(int threads) {
  constexpr int kWidth = 193, kHeight = 211;
  std::vector<Real> results;
  const auto x = RandomPlanes<Real>(kWidth, kHeight, 3, 11);
  for (const Axis axis : {Axis::kAcross, Axis::kDown}) {
    const auto filter = RandomFilter<Real>(axis, kWidth, kHeight, 12);
    Planes<Real> y(kWidth, kHeight, 3, 0);
    Apply(filter, x.in(), y.out(), threads);
    results.insert(results.end(), y.values.begin(), y.values.end());
    ApplyTransposed(filter, x.in(), y.out(), threads);
    results.insert(results.end(), y.values.begin(), y.values.end());
  }
  return results;
}

TYPED_TEST(ImageFilterTest, ThreadsDoNotChangeABit) {
  const std::vector<TypeParam> one = AllResults<TypeParam>(1);
  // Several runs give two threads a chance to disturb each other.
  for (const int threads : {2, 3, 7, 2, 2, 2, 2, 2}) {
    const std::vector<TypeParam> many = AllResults<TypeParam>(threads);
    ASSERT_EQ(many.size(), one.size());
    EXPECT_EQ(std::memcmp(many.data(), one.data(), one.size() * sizeof(TypeParam)), 0)
        << threads << " threads";
  }
}

template <typename Change>
std::string FilterError(Axis axis, const Change& change) {
  VaryingFilter<float> filter;
  filter.axis = axis;
  filter.width_px = 65;
  filter.height_px = 2;
  filter.radius_px = std::vector<std::int32_t>{1, 0, 0, 1};
  filter.start = std::vector<std::size_t>{0, 192, 256, 320, 512};
  filter.coefficients.assign(512, 0.0f);
  change(&filter);
  return ErrorOf([&] { Check(filter); });
}

TEST(ImageFilterCheckTest, WrongFiltersAreNamed) {
  using Filter = VaryingFilter<float>;
  const Axis across = Axis::kAcross;
  EXPECT_EQ(FilterError(across, [](Filter*) {}), "(no error)");
  EXPECT_EQ(FilterError(across, [](Filter* f) { f->width_px = -1; }),
            "filter: width_px and height_px are -1 and 2: they must be >= 0, and their product at "
            "most 2147483647");
  EXPECT_EQ(FilterError(across, [](Filter* f) { f->width_px = f->height_px = 1 << 16; }),
            "filter: width_px and height_px are 65536 and 65536: they must be >= 0, and their "
            "product at most 2147483647");
  EXPECT_EQ(FilterError(across, [](Filter* f) { f->radius_px.pop_back(); }),
            "filter: radius_px has 3 elements: it must have 4");
  EXPECT_EQ(FilterError(across, [](Filter* f) { f->radius_px[2] = -1; }),
            "filter: radius_px of block 2 is -1: it must be >= 0");
  EXPECT_EQ(FilterError(across, [](Filter* f) { f->start.pop_back(); }),
            "filter: start has 4 elements: it must have 5");
  EXPECT_EQ(FilterError(across, [](Filter* f) { f->start[0] = 1; }),
            "filter: start begins with 1: it must begin with 0");
  EXPECT_EQ(
      FilterError(across, [](Filter* f) { f->start[2] = 250; }),
      "filter: start of block 2 is 250: it must be 256, because the previous block has radius 0");
  EXPECT_EQ(FilterError(across, [](Filter* f) { f->coefficients.pop_back(); }),
            "filter: coefficients has 511 elements: it must have 512");
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(
      FilterError(across, [&](Filter* f) { f->coefficients[64 + 3] = nan; }),
      "filter: coefficients: the coefficient n = 0 of pixel (3, 0) is nan: it must be finite");
}

TEST(ImageFilterCheckTest, CoefficientsOutsideAreNamed) {
  using Filter = VaryingFilter<float>;
  const std::string outside = ": it must be 0, because it is outside the image of 65 x 2 pixels";
  EXPECT_EQ(FilterError(Axis::kAcross, [](Filter* f) { f->coefficients[0] = 1; }),
            "filter: coefficients: the coefficient n = -1 of pixel (0, 0) is 1" + outside);
  EXPECT_EQ(FilterError(Axis::kAcross, [](Filter* f) { f->coefficients[1] = 1; }), "(no error)");
  EXPECT_EQ(FilterError(Axis::kAcross, [](Filter* f) { f->coefficients[192 + 1] = 1; }),
            "filter: coefficients: the coefficient n = 0 of pixel (65, 0) is 1" + outside);
  EXPECT_EQ(FilterError(Axis::kAcross, [](Filter* f) { f->coefficients[320 + 128] = 1; }),
            "filter: coefficients: the coefficient n = 1 of pixel (64, 1) is 1" + outside);
  EXPECT_EQ(FilterError(Axis::kDown, [](Filter* f) { f->coefficients[5] = 1; }),
            "filter: coefficients: the coefficient n = -1 of pixel (5, 0) is 1" + outside);
  EXPECT_EQ(FilterError(Axis::kDown, [](Filter* f) { f->coefficients[192 + 1] = 1; }),
            "filter: coefficients: the coefficient n = 0 of pixel (65, 0) is 1" + outside);
  EXPECT_EQ(FilterError(Axis::kDown, [](Filter* f) { f->coefficients[320 + 128] = 1; }),
            "filter: coefficients: the coefficient n = 1 of pixel (64, 1) is 1" + outside);
  EXPECT_EQ(FilterError(Axis::kDown, [](Filter* f) { f->coefficients[128 + 63] = 1; }),
            "(no error)");
}

}  // namespace
}  // namespace thicklens::kernels
