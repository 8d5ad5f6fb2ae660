// A picture read for a view, against sums by hand; and a device's views against these.
#include "thicklens/kernels/view_warp.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "opencl_device.h"
#include "opencl_program.h"
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

// The twin, a device as it is (a machine on which tests run has one), or as one whose items are
// single samples.
enum class Form { kTwin, kDevice, kSingleSamples };

std::unique_ptr<ViewWarp> NewWarp(Form form, const SurfacePicture& picture) {
  if (form == Form::kTwin) return NewReferenceWarp(picture);
  static const auto opened = [] {
    const DeviceRequest place =
        ParseDeviceRequest(OpenBackend(ParseDeviceRequest("opencl"), nullptr)->name());
    return OpenOpenClDevice(place.platform, place.device);
  }();
  const auto device = std::make_shared<OpenClDevice>(*opened);
  if (form == Form::kSingleSamples) device->is_cpu = false;
  static std::map<Form, cl::Program> programs;
  if (programs.count(form) == 0) programs[form] = BuildKernels(*device, "float");
  return NewOpenClWarp(device, programs[form], picture);
}

class ViewWarpTest : public ::testing::TestWithParam<Form> {
 protected:
  std::vector<float> Warp(int channels = 1) {
    picture_ = {kW, kH, channels, &values_, &disparity_, 0.3F};
    std::vector<float> values;
    NewWarp(GetParam(), picture_)->Warp({&of_view_, &source_x_, &source_y_}, &values);
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
INSTANTIATE_TEST_SUITE_P(Twin, ViewWarpTest, ::testing::Values(Form::kTwin));
INSTANTIATE_TEST_SUITE_P(Device, ViewWarpTest, ::testing::Values(Form::kDevice));
INSTANTIATE_TEST_SUITE_P(SingleSamples, ViewWarpTest, ::testing::Values(Form::kSingleSamples));

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
  source_x_.assign(kPixels, 0.5F);
  // Left of an edge, where four pixels are read, 16, and one.
  for (int y = 0; y < kH; ++y) disparity_[At(9, y)] = 1;
  for (const std::size_t channels : {1, 2, 3, 4, 5, 8, 9}) {
    values_.clear();
    for (std::size_t i = 0; i < kPixels; ++i) {
      for (std::size_t c = 0; c < channels; ++c) {
        values_.push_back(static_cast<float>(1 + c) * static_cast<float>(i % kW));
      }
    }
    const std::vector<float> warped = Warp(static_cast<int>(channels));
    ASSERT_EQ(warped.size(), channels * kPixels);
    for (std::size_t c = 0; c < channels; ++c) {
      const auto factor = static_cast<double>(1 + c);
      EXPECT_NEAR(warped[channels * At(4, 3) + c], 4.5 * factor, 1e-5) << c << " of " << channels;
      EXPECT_NEAR(warped[channels * At(7, 3) + c], 7.5 * factor, 1e-5) << c << " of " << channels;
      EXPECT_NEAR(warped[channels * At(8, 3) + c], 8 * factor, 1e-5) << c << " of " << channels;
    }
  }
}

TEST_P(ViewWarpTest, RefusesWhatDoesNotFit) {
  source_y_.pop_back();
  EXPECT_THAT(ErrorOf([&] { Warp(); }), HasSubstr("sources of a view down: 107 numbers"));
  source_y_.push_back(0);
  values_.push_back(0);
  EXPECT_THAT(ErrorOf([&] { Warp(); }), HasSubstr("there must be 108"));
}

// Pictures of all kinds of sizes and channels, surfaces that are flat, rough and steep.
class DeviceWarpTest : public ::testing::TestWithParam<Form> {};
INSTANTIATE_TEST_SUITE_P(Device, DeviceWarpTest, ::testing::Values(Form::kDevice));
INSTANTIATE_TEST_SUITE_P(SingleSamples, DeviceWarpTest, ::testing::Values(Form::kSingleSamples));

TEST_P(DeviceWarpTest, IsThatOfTheTwin) {
  struct Case {
    int width, height, channels;
  };
  std::mt19937 engine(7);
  const auto numbers = [&](int count, float low, float high) {
    std::uniform_real_distribution<float> uniform(low, high);
    std::vector<float> result(static_cast<std::size_t>(count));
    for (float& number : result) number = uniform(engine);
    return result;
  };
  for (const Case& c : std::vector<Case>{{1, 1, 1},
                                         {1, 1, 3},
                                         {3, 40, 1},
                                         {15, 7, 2},
                                         {16, 9, 3},
                                         {17, 12, 4},
                                         {40, 2, 5},
                                         {64, 33, 1},
                                         {77, 30, 3},
                                         {33, 5, 8},
                                         {35, 6, 11}}) {
    const int pixels = c.width * c.height;
    const auto values = numbers(pixels * c.channels, 0, 1);
    auto disparity = numbers(pixels, -0.1F, 0.1F);
    for (std::size_t i = 0; i < disparity.size(); ++i) {
      const int x = static_cast<int>(i) % c.width;
      if (3 * x > 2 * c.width) disparity[i] *= 5;
      if (3 * x < c.width) disparity[i] += 1;
    }
    const SurfacePicture picture{c.width, c.height, c.channels, &values, &disparity, 0.3F};
    const auto of_view = numbers(pixels, -0.5F, 1.5F);
    for (const float reach : {0.0F, 3.0F, 300.0F}) {
      const auto source_x = numbers(pixels, -reach, reach);
      const auto source_y = numbers(pixels, -reach, reach);
      for (const std::vector<float>* surface : {&std::as_const(disparity), &of_view}) {
        std::vector<float> found, right;
        NewWarp(GetParam(), picture)->Warp({surface, &source_x, &source_y}, &found);
        NewWarp(Form::kTwin, picture)->Warp({surface, &source_x, &source_y}, &right);
        EXPECT_THAT(found, ::testing::Pointwise(FloatNear(3e-6F), right))
            << c.width << "x" << c.height << ", " << c.channels << " channels, " << reach << " px";
      }
    }
  }
}

}  // namespace
}  // namespace thicklens::kernels
