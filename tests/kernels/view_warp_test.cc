// A picture read for a view, against sums by hand; and a device's views against these.
#include "thicklens/kernels/view_warp.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "support/error_message.h"
#include "thicklens/kernels/device.h"

namespace thicklens::kernels {
namespace {

using ::testing::Each;
using ::testing::FloatNear;
using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;

constexpr int kW = 12, kH = 9;
constexpr std::size_t kPixels = kW * kH;

std::size_t At(int x, int y) { return static_cast<std::size_t>(y * kW + x); }

// Every test with the twin and with a device: a machine on which tests run has one.
class ViewWarpTest : public ::testing::TestWithParam<const char*> {
 protected:
  std::vector<float> Warp(int channels = 1) {
    picture_ = {kW, kH, channels, &values_, &disparity_, 0.3F};
    const auto backend = OpenBackend(ParseDeviceRequest(GetParam()), nullptr);
    std::vector<float> values;
    backend->NewWarp(picture_)->Warp({&of_view_, &source_x_, &source_y_}, &values);
    return values;
  }
  void FillPolynomial() {  // cubic interpolation is exact for squares
    for (int y = 0; y < kH; ++y) {
      for (int x = 0; x < kW; ++x)
        values_[At(x, y)] = Polynomial(static_cast<float>(x), static_cast<float>(y));
    }
  }
  static float Polynomial(float x, float y) {
    return 0.1F * x + 0.02F * x * x - 0.03F * y * y + 0.005F * x * y;
  }

  std::vector<float> values_ = std::vector<float>(kPixels, 0.0F);
  std::vector<float> disparity_ = std::vector<float>(kPixels, 0.0F);
  std::vector<float> of_view_ = std::vector<float>(kPixels, 0.0F);
  std::vector<float> source_x_ = std::vector<float>(kPixels, 0.0F);
  std::vector<float> source_y_ = std::vector<float>(kPixels, 0.0F);
  SurfacePicture picture_;
};
INSTANTIATE_TEST_SUITE_P(Twin, ViewWarpTest, ::testing::Values("cpu"));
INSTANTIATE_TEST_SUITE_P(Device, ViewWarpTest, ::testing::Values("opencl"));

TEST_P(ViewWarpTest, IsThePictureWhereNothingMoves) {
  FillPolynomial();
  EXPECT_THAT(Warp(), ::testing::Pointwise(FloatNear(1e-6F), values_));
}

TEST_P(ViewWarpTest, IsExactForSquaresInsideOfASurface) {
  FillPolynomial();
  source_x_.assign(kPixels, 0.375F);
  source_y_.assign(kPixels, -0.25F);
  const std::vector<float> warped = Warp();
  for (int y = 2; y < kH - 2; ++y) {
    for (int x = 1; x < kW - 2; ++x) {
      const auto at_x = static_cast<float>(x) + 0.375F, at_y = static_cast<float>(y) - 0.25F;
      EXPECT_NEAR(warped[At(x, y)], Polynomial(at_x, at_y), 1e-5) << x << ", " << y;
    }
  }
}

TEST_P(ViewWarpTest, StaysOnItsSurface) {
  // Bright pixels to the right are of another surface.
  for (int y = 0; y < kH; ++y) {
    for (int x = 0; x < kW; ++x) {
      values_[At(x, y)] = x < 6 ? 0.25F : 1.0F;
      disparity_[At(x, y)] = x < 6 ? 0.0F : 1.0F;
    }
  }
  source_x_.assign(kPixels, 0.5F);
  std::vector<float> warped = Warp();
  EXPECT_NEAR(warped[At(5, 4)], 0.25, 1e-6);  // of 5 and 6 only 5 is the sample's
  EXPECT_NEAR(warped[At(4, 4)], 0.25, 1e-6);  // no bicubic taps past the edge
  of_view_.assign(kPixels, 1.0F);
  warped = Warp();
  EXPECT_NEAR(warped[At(5, 4)], 1, 1e-6);
  // On no surface around: the one that is nearest in disparity.
  of_view_.assign(kPixels, 0.6F);
  EXPECT_NEAR(Warp()[At(5, 4)], 1, 1e-6);
  of_view_.assign(kPixels, 0.4F);
  EXPECT_NEAR(Warp()[At(5, 4)], 0.25, 1e-6);
}

TEST_P(ViewWarpTest, WeighsWhatIsLeftOfTheFourAround) {
  for (std::size_t i = 0; i < kPixels; ++i) values_[i] = static_cast<float>(i);
  disparity_[At(5, 5)] = 9;
  source_x_.assign(kPixels, 0.25F);
  source_y_.assign(kPixels, 0.5F);
  // At (4.25, 4.5): without (5, 5).
  const float expected =
      (0.375F * values_[At(4, 4)] + 0.125F * values_[At(5, 4)] + 0.375F * values_[At(4, 5)]) /
      (0.375F + 0.125F + 0.375F);
  EXPECT_NEAR(Warp()[At(4, 4)], expected, 1e-4);
}

TEST_P(ViewWarpTest, IsCutToThePicture) {
  FillPolynomial();
  source_x_.assign(kPixels, -1e30F);
  source_y_.assign(kPixels, 1e30F);
  EXPECT_THAT(Warp(), Each(FloatNear(values_[At(0, kH - 1)], 1e-5F)));
}

TEST_P(ViewWarpTest, KeepsChannelsApart) {
  values_.clear();
  for (std::size_t i = 0; i < kPixels; ++i) {
    for (const float channel : {1.0F, 2.0F, 4.0F, 8.0F}) {
      values_.push_back(channel * static_cast<float>(i % kW));
    }
  }
  source_x_.assign(kPixels, 0.5F);
  const std::vector<float> warped = Warp(4);
  ASSERT_EQ(warped.size(), 4 * kPixels);
  for (std::size_t c = 0; c < 4; ++c) {
    EXPECT_NEAR(warped[4 * At(4, 3) + c], 4.5 * static_cast<double>(1U << c), 1e-5);
  }
}

TEST_P(ViewWarpTest, RefusesWhatDoesNotFit) {
  source_y_.pop_back();
  EXPECT_THAT(ErrorOf([&] { Warp(); }), HasSubstr("sources of a view down: 107 numbers"));
  source_y_.push_back(0);
  values_.push_back(0);
  EXPECT_THAT(ErrorOf([&] { Warp(); }), HasSubstr("there must be 108"));
}

}  // namespace
}  // namespace thicklens::kernels
