// The reference is compared with sums computed by hand, and a device's views with the reference.
#include "thicklens/kernels/view_warp.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "kernels/opencl/opencl_device.h"
#include "kernels/opencl/opencl_program.h"
#include "support/error_message.h"
#include "thicklens/kernels/device.h"
#include "thicklens/kernels/kernels.h"

namespace thicklens::kernels {
namespace {

using ::testing::Each;
using ::testing::FloatNear;
using ::testing::HasSubstr;
using thicklens::testing::ErrorOf;

constexpr int kW = 12, kH = 9;
constexpr std::size_t kPixels = kW * kH;
constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

std::size_t At(int x, int y) { return static_cast<std::size_t>(y * kW + x); }

// The reference, a device as it is (a machine that runs the tests has one), or one with single
// samples as its items.
enum class Form { kReference, kDevice, kSingleSamples };

std::unique_ptr<ViewWarp> NewWarp(Form form, const SurfaceImage& image) {
  if (form == Form::kReference) return NewReferenceWarp(image);
  static const auto opened = [] {
    const DeviceRequest place =
        ParseDeviceRequest(OpenBackend(ParseDeviceRequest("opencl"), nullptr)->name());
    return OpenOpenClDevice(place.platform, place.device);
  }();
  const auto device = std::make_shared<OpenClDevice>(*opened);
  if (form == Form::kSingleSamples) device->is_cpu = false;
  static std::map<Form, cl::Program> programs;
  if (programs.count(form) == 0) programs[form] = BuildKernels(*device, "float");
  return NewOpenClWarp(device, programs[form], image);
}

class ViewWarpTest : public ::testing::TestWithParam<Form> {
 protected:
  std::vector<float> Warp(int channels = 1) {
    image_ = {kW, kH, channels, &values_, &disparity_, 0.3F};
    std::vector<float> values;
    NewWarp(GetParam(), image_)
        ->Warp({&of_view_, shift_x_, shift_y_, &occluded_, &boundary_}, &values);
    return values;
  }
  void Hide(std::size_t i, float source_x, float source_y) {
    occluded_.push_back({static_cast<std::int32_t>(i), source_x, source_y, of_view_[i]});
    of_view_[i] = kNone;
  }
  // Hides all samples, with that disparity.
  void HideAll(float source_x, float source_y, float disparity) {
    occluded_.clear();
    of_view_.assign(kPixels, disparity);
    for (std::size_t i = 0; i < kPixels; ++i) Hide(i, source_x, source_y);
  }
  // Gives the image and the view one disparity.
  void Flatten(float disparity) {
    disparity_.assign(kPixels, disparity);
    of_view_.assign(kPixels, disparity);
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
  double shift_x_ = 0, shift_y_ = 0;
  std::vector<OccludedSample> occluded_;
  std::vector<BoundarySample> boundary_;
  SurfaceImage image_;
};
INSTANTIATE_TEST_SUITE_P(Reference, ViewWarpTest, ::testing::Values(Form::kReference));
INSTANTIATE_TEST_SUITE_P(Device, ViewWarpTest, ::testing::Values(Form::kDevice));
INSTANTIATE_TEST_SUITE_P(SingleSamples, ViewWarpTest, ::testing::Values(Form::kSingleSamples));

TEST_P(ViewWarpTest, IsTheImageWhereNothingMoves) {
  FillPolynomial();
  EXPECT_THAT(Warp(), ::testing::Pointwise(FloatNear(1e-6F), values_));
  shift_x_ = 2, shift_y_ = -3;  // px per unit of disparity
  EXPECT_THAT(Warp(), ::testing::Pointwise(FloatNear(1e-6F), values_));
}

TEST_P(ViewWarpTest, IsExactForSquaresInsideOfASurface) {
  FillPolynomial();
  const auto expect_squares = [&](const std::vector<float>& warped) {
    for (int y = 2; y < kH - 2; ++y) {
      for (int x = 1; x < kW - 2; ++x) {
        const auto at_x = static_cast<float>(x) + 0.375F, at_y = static_cast<float>(y) - 0.25F;
        EXPECT_NEAR(warped[At(x, y)], Polynomial(at_x, at_y), 1e-5) << x << ", " << y;
      }
    }
  };
  Flatten(0.5F);
  shift_x_ = 0.75, shift_y_ = -0.5;
  expect_squares(Warp());
  HideAll(0.375F, -0.25F, 0.5F);
  expect_squares(Warp());
}

TEST_P(ViewWarpTest, ReadsOccludedSamplesWhereTheyAre) {
  for (std::size_t i = 0; i < kPixels; ++i) values_[i] = static_cast<float>(i);
  Flatten(2);
  disparity_[At(9, 6)] = 0;
  shift_x_ = 0.5;  // one pixel
  Hide(At(0, 0), 11, 8);
  Hide(At(4, 5), 5, 1);  // lands at (9, 6), which is of another surface
  occluded_.back().disparity = 0;
  Hide(At(11, 8), -11, 0);
  const std::vector<float> warped = Warp();
  EXPECT_EQ(warped[At(0, 0)], values_[At(11, 8)]);
  EXPECT_EQ(warped[At(4, 5)], values_[At(9, 6)]);
  EXPECT_EQ(warped[At(11, 8)], values_[At(0, 8)]);
  EXPECT_EQ(warped[At(1, 0)], values_[At(2, 0)]);
  EXPECT_EQ(warped[At(5, 5)], values_[At(6, 5)]);
  EXPECT_EQ(warped[At(10, 8)], values_[At(11, 8)]);
}

TEST_P(ViewWarpTest, MixesWhatStandsAtAnotherPlaceIntoASample) {
  for (std::size_t i = 0; i < kPixels; ++i) values_[i] = static_cast<float>(i);
  Flatten(2);
  disparity_[At(9, 6)] = 0;
  shift_x_ = 0.5;  // one pixel
  Hide(At(4, 5), 5, 1);
  occluded_.back().disparity = 0;
  const auto mix = [&](std::size_t at, float source_x, float source_y, float disparity,
                       float share) {
    boundary_.push_back({static_cast<std::int32_t>(at), {0, source_x, source_y, disparity}, share});
  };
  mix(At(0, 0), 3.25F, 2.5F, 2, 0.25F);  // interpolated between four pixels
  mix(At(2, 2), -400, 3, 2, 1);          // clamped to the image
  mix(At(4, 5), 1, 0, 2, 0.75F);         // into an occluded sample
  mix(At(8, 6), 0.5F, 0, 0, 0.5F);       // the pixel of the two that is of its surface
  mix(At(11, 8), 0.5F, 0.5F, 2, 0);      // a fraction of 0 has no effect
  const std::vector<float> plain = [&] {
    const std::vector<BoundarySample> boundary = std::exchange(boundary_, {});
    std::vector<float> values = Warp();
    boundary_ = boundary;
    return values;
  }();
  std::vector<float> expected = plain;
  const auto share = [&](std::size_t at, float other, float of_it) {
    expected[at] = (1 - of_it) * plain[at] + of_it * other;
  };
  const auto w = static_cast<float>(kW);
  share(At(0, 0), 3.25F + 2.5F * w, 0.25F);
  share(At(2, 2), values_[At(0, 5)], 1);
  share(At(4, 5), values_[At(5, 5)], 0.75F);
  share(At(8, 6), values_[At(9, 6)], 0.5F);
  EXPECT_THAT(Warp(), ::testing::Pointwise(FloatNear(1e-5F), expected));
}

// In float, the shift would round down to the pixel before its target, and that pixel is of another
// surface.
TEST_P(ViewWarpTest, TakesAShiftWithMoreDigitsThanAFloat) {
  for (std::size_t i = 0; i < kPixels; ++i) values_[i] = static_cast<float>(i % kW);
  Flatten(2.6F);
  disparity_[At(7, 4)] = 9;
  shift_x_ = 3.0 / double{2.6F};
  ASSERT_LT(static_cast<float>(shift_x_) * 2.6F, 3);
  EXPECT_EQ(Warp()[At(4, 4)], 7);
}

TEST_P(ViewWarpTest, StaysOnItsSurface) {
  // The bright pixels to the right are of another surface.
  for (int y = 0; y < kH; ++y) {
    for (int x = 0; x < kW; ++x) {
      values_[At(x, y)] = x < 6 ? 0.25F : 1.0F;
      disparity_[At(x, y)] = x < 6 ? 0.0F : 1.0F;
    }
  }
  HideAll(0.5F, 0, 0);
  const std::vector<float> warped = Warp();
  // Pixel 5 is part of the sample's surface, and pixel 6 is not.
  EXPECT_NEAR(warped[At(5, 4)], 0.25, 1e-6);
  EXPECT_NEAR(warped[At(4, 4)], 0.25, 1e-6);  // no bicubic taps past the edge
  HideAll(0.5F, 0, 1);
  EXPECT_NEAR(Warp()[At(5, 4)], 1, 1e-6);
  // If no surface around matches, the one that is nearest in disparity is used.
  HideAll(0.5F, 0, 0.6F);
  EXPECT_NEAR(Warp()[At(5, 4)], 1, 1e-6);
  HideAll(0.5F, 0, 0.4F);
  EXPECT_NEAR(Warp()[At(5, 4)], 0.25, 1e-6);
  // Visible samples behave the same.
  occluded_.clear();
  of_view_.assign(kPixels, 0.625F);
  shift_x_ = 0.8;
  EXPECT_NEAR(Warp()[At(5, 4)], 1, 1e-6);
  of_view_.assign(kPixels, 0.25F);
  shift_x_ = 2;
  EXPECT_NEAR(Warp()[At(5, 4)], 0.25, 1e-6);
}

TEST_P(ViewWarpTest, WeightsTheRemainingOfTheFourNeighbours) {
  for (std::size_t i = 0; i < kPixels; ++i) values_[i] = static_cast<float>(i);
  disparity_[At(5, 5)] = 9;
  HideAll(0.25F, 0.5F, 0);
  // The sample at (4.25, 4.5) is interpolated without the pixel (5, 5).
  const float expected =
      (0.375F * values_[At(4, 4)] + 0.125F * values_[At(5, 4)] + 0.375F * values_[At(4, 5)]) /
      (0.375F + 0.125F + 0.375F);
  EXPECT_NEAR(Warp()[At(4, 4)], expected, 1e-4);
}

TEST_P(ViewWarpTest, IsCutToTheImage) {
  FillPolynomial();
  HideAll(-1e30F, 1e30F, 0);
  EXPECT_THAT(Warp(), Each(FloatNear(values_[At(0, kH - 1)], 1e-5F)));
  occluded_.clear();
  Flatten(0.5F);
  for (const double far : {1e3, 1e30, 1e38}) {
    shift_x_ = -far, shift_y_ = far;
    EXPECT_THAT(Warp(), Each(FloatNear(values_[At(0, kH - 1)], 1e-5F))) << far;
  }
}

TEST_P(ViewWarpTest, KeepsChannelsApart) {
  Flatten(1);
  shift_x_ = 0.5;
  // Near the edge, four pixels are read, or 16, or one.
  for (int y = 0; y < kH; ++y) disparity_[At(9, y)] = 2;
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
  of_view_.pop_back();
  EXPECT_THAT(ErrorOf([&] { Warp(); }), HasSubstr("disparity of a view: it has 107 numbers"));
  of_view_.push_back(0);
  for (const std::int32_t index : {-1, 108}) {
    occluded_ = {{index, 0, 0, 0}};
    EXPECT_THAT(ErrorOf([&] { Warp(); }),
                HasSubstr(std::to_string(index) + ": it must be 0 to 107"));
  }
  occluded_ = {{5, 0, 0, 0}};
  EXPECT_THAT(ErrorOf([&] { Warp(); }),
              HasSubstr("occluded sample 5 of a view has the disparity 0"));
  occluded_.clear();
  for (const std::int32_t index : {-1, 7, 108}) {
    boundary_ = {{7, {}, 0.5F}, {index, {}, 0.5F}};
    EXPECT_THAT(
        ErrorOf([&] { Warp(); }),
        HasSubstr(std::to_string(index) + " after 7: indices must ascend from 0 to at most 107"));
  }
  for (const float share : {-0.1F, 1.1F, kNone}) {
    boundary_ = {{7, {}, share}};
    EXPECT_THAT(ErrorOf([&] { Warp(); }), HasSubstr("boundary sample 7 of a view has the share"));
  }
  boundary_.clear();
  shift_y_ = kNone;
  EXPECT_THAT(ErrorOf([&] { Warp(); }), HasSubstr("shift of a view is nan"));
  shift_y_ = 0;
  values_.push_back(0);
  EXPECT_THAT(ErrorOf([&] { Warp(); }), HasSubstr("it must have 108"));
}

TEST_P(ViewWarpTest, IsUsedByManyThreads) {
  for (std::size_t i = 0; i < kPixels; ++i) values_[i] = static_cast<float>(i);
  Flatten(1);
  Hide(At(6, 4), 0, 0);
  image_ = {kW, kH, 1, &values_, &disparity_, 0.3F};
  const std::unique_ptr<ViewWarp> warp = NewWarp(GetParam(), image_);
  constexpr std::size_t kThreads = 4;
  std::array<std::vector<float>, kThreads> warped;
  std::vector<std::thread> threads;
  for (std::size_t t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {  // each thread shifts by another number of pixels
      for (int i = 0; i < 20; ++i) {
        warp->Warp({&of_view_, static_cast<double>(t), 0, &occluded_, nullptr}, &warped[t]);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  for (std::size_t t = 0; t < kThreads; ++t) {
    EXPECT_EQ(warped[t][At(3, 3)], values_[At(3 + static_cast<int>(t), 3)]);
    EXPECT_EQ(warped[t][At(6, 4)], values_[At(6, 4)]);
  }
}

// The images have various sizes and numbers of channels, and surfaces that are flat, rough or
// steep.
class DeviceWarpTest : public ::testing::TestWithParam<Form> {};
INSTANTIATE_TEST_SUITE_P(Device, DeviceWarpTest, ::testing::Values(Form::kDevice));
INSTANTIATE_TEST_SUITE_P(SingleSamples, DeviceWarpTest, ::testing::Values(Form::kSingleSamples));

TEST_P(DeviceWarpTest, IsThatOfTheReference) {
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
    const SurfaceImage image{c.width, c.height, c.channels, &values, &disparity, 0.3F};
    const auto of_view = numbers(pixels, -0.5F, 1.5F);
    const auto shares = numbers(pixels, 0, 1);
    for (const float reach : {0.0F, 3.0F, 300.0F}) {
      const auto shift = numbers(2, -reach, reach);
      const auto source_x = numbers(pixels, -reach, reach);
      const auto source_y = numbers(pixels, -reach, reach);
      for (const std::vector<float>* surface : {&std::as_const(disparity), &of_view}) {
        // No sample is hidden, then the first, every third, and all of them.
        for (const int every : {0, pixels, 3, 1}) {
          std::vector<float> seen = *surface;
          std::vector<OccludedSample> occluded;
          for (int i = 0; every > 0 && i < pixels; i += every) {
            const auto n = static_cast<std::size_t>(i);
            occluded.push_back({i, source_x[n], source_y[n], seen[n]});
            seen[n] = kNone;
          }
          std::vector<BoundarySample> boundary;
          for (int i = every % 5; i < pixels; i += 2 + every % 3) {
            const std::size_t n = static_cast<std::size_t>(pixels - 1 - i);
            boundary.push_back({i, {0, source_x[n], source_y[n], (*surface)[n]}, shares[n]});
          }
          const ViewSources view{&seen, shift[0], shift[1], &occluded, &boundary};
          std::vector<float> found, right;
          NewWarp(GetParam(), image)->Warp(view, &found);
          NewWarp(Form::kReference, image)->Warp(view, &right);
          EXPECT_THAT(found, ::testing::Pointwise(FloatNear(3e-6F), right))
              << c.width << "x" << c.height << ", " << c.channels << " channels, " << reach
              << " px, hidden every " << every;
        }
      }
    }
  }
}

}  // namespace
}  // namespace thicklens::kernels
