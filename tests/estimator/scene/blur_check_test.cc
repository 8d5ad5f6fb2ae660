#include "thicklens/estimator/blur_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <stdexcept>
#include <vector>

#include "support/error_message.h"
#include "support/sanitizers.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::estimator {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;
using thicklens::testing::ErrorOf;

constexpr int kW = 192, kH = 128;
constexpr int kViews = 5;

// Smooth noise of details of 4 px.
class Texture {
 public:
  Texture() : values_(static_cast<std::size_t>(kSide) * kSide) {
    std::mt19937 engine(5);
    std::uniform_real_distribution<double> value(0.15, 0.85);
    for (double& knot : values_) knot = value(engine);
  }
  double operator()(double x, double y) const {
    const double u = x / kCellPx + kSide / 2, v = y / kCellPx + kSide / 2;
    const double i = std::floor(u), j = std::floor(v);
    const double a = Smooth(u - i), b = Smooth(v - j);
    return (1 - b) * ((1 - a) * At(i, j) + a * At(i + 1, j)) +
           b * ((1 - a) * At(i, j + 1) + a * At(i + 1, j + 1));
  }

 private:
  static constexpr int kSide = 256;
  static constexpr double kCellPx = 4;
  static double Smooth(double t) { return t * t * (3 - 2 * t); }
  double At(double i, double j) const {
    return values_[static_cast<std::size_t>(j) * kSide + static_cast<std::size_t>(i)];
  }
  std::vector<double> values_;
};

// Disparity of a plane, at column x: from -1 to 1 px per view step.
constexpr double kSlope = 2.0 / kW;
double DisparityAt(double x) { return kSlope * (x - kW / 2.0); }

// The photograph of that plane, computed from rays through an aperture of 15 x 15 samples that has
// the second moment of kViews x kViews samples of the same weight. The point at p in the centre
// view is at p - d(p) a in the view a, so that the pixel x shows p = (x - kSlope kW/2 a)/(1 -
// kSlope a).
EstimateInput PlaneInput() {
  constexpr int kFine = 15;
  const double step = std::sqrt((kViews * kViews - 1.0) / (kFine * kFine - 1.0));
  const Texture texture;
  EstimateInput input;
  input.image = {kW, kH, 1, {}};
  input.disparity = {kW, kH, {}, {1, 1}};
  input.weights = model::ApertureWeights(model::ApertureShape::kUniform, kViews, kViews);
  input.transfer = model::TransferCurve::Linear();
  std::mt19937 engine(9);
  std::normal_distribution<double> noise(0, 1.0 / 255);
  for (int y = 0; y < kH; ++y) {
    for (int x = 0; x < kW; ++x) {
      double sum = 0;
      for (int k = 0; k < kFine; ++k) {
        const double a = step * (k - (kFine - 1) / 2);
        const double p = (x - kSlope * kW / 2.0 * a) / (1 - kSlope * a);
        for (int l = 0; l < kFine; ++l) {
          const double b = step * (l - (kFine - 1) / 2);
          sum += texture(p, y + DisparityAt(p) * b);
        }
      }
      const double stored = sum / (kFine * kFine) + noise(engine);
      input.image.values.push_back(static_cast<float>(std::round(255 * stored) / 255));
      input.disparity.disparity.push_back(static_cast<float>(DisparityAt(x)));
    }
  }
  return input;
}

const EstimateInput& Plane() {
  static const EstimateInput input = PlaneInput();
  return input;
}

EstimateInput PlaneWith(double scale, double offset_px) {
  EstimateInput input = Plane();
  for (float& value : input.disparity.disparity) {
    value = static_cast<float>(scale * static_cast<double>(value) + offset_px);
  }
  return input;
}

TEST(BlurCheck, TheRightBlurIsLeftAloneAfterOneSolve) {
  const BlurCheck check = CheckBlur(Plane(), {});
  EXPECT_FALSE(check.narrower_blur);
  EXPECT_FALSE(check.other_focus);
  EXPECT_THAT(check.trials, SizeIs(1));
  EXPECT_GT(check.blocks, 10);
  EXPECT_EQ(check.unexplained_blocks, 0);
  EXPECT_THAT(check.message, HasSubstr("the photograph does not indicate a narrower blur"));
}

TEST(BlurCheck, TooWideABlurIsProposedNarrower) {
  for (const double scale : {1.4, 1.7}) {
    const BlurCheck check = CheckBlur(PlaneWith(scale, 0), {});
    ASSERT_TRUE(check.narrower_blur) << scale << " " << check.message;
    EXPECT_NEAR(check.narrower_blur->blur_scale * scale, 1, 0.15);
    EXPECT_LT(check.narrower_blur->unexplained, 0.25);
    EXPECT_LT(check.narrower_blur->score, 0.8);
    // The plane lies on both sides of the focus, and neither is explained.
    EXPECT_FALSE(check.other_focus) << scale;
    EXPECT_GT(check.iterations, 0);
  }
}

TEST(BlurCheck, TooNarrowABlurGivesNoReport) {
  const BlurCheck check = CheckBlur(PlaneWith(0.7, 0), {});
  EXPECT_FALSE(check.narrower_blur);
  EXPECT_FALSE(check.other_focus);
  EXPECT_EQ(check.unexplained_blocks, 0);
}

TEST(BlurCheck, AnotherFocusIsProposedOnTheSideWhereItIs) {
  for (const double offset_px : {-0.5, 0.5}) {
    const BlurCheck check = CheckBlur(PlaneWith(1, offset_px), {});
    ASSERT_TRUE(check.other_focus) << offset_px << " " << check.message;
    EXPECT_NEAR(check.other_focus->focus_offset_px, -offset_px, 0.25);
    EXPECT_EQ(check.other_focus->blur_scale, 1);
  }
}

// Half the disparity in px at twice the step gives the same blur.
TEST(BlurCheck, OffsetsArePxWhateverTheUnitOfTheMap) {
  EstimateInput input = PlaneWith(1, 0.5);
  input.disparity.step = {-2, -2};
  for (float& value : input.disparity.disparity) value /= -2;
  const BlurCheck check = CheckBlur(input, {});
  ASSERT_TRUE(check.other_focus);
  EXPECT_NEAR(check.other_focus->focus_offset_px, -0.5, 0.25);
}

TEST(BlurCheck, DoesNotDependOnTheNumberOfThreads) {
  BlurCheckOptions options;
  options.threads = 1;
  const BlurCheck one = CheckBlur(PlaneWith(1.5, 0), options);
  options.threads = 3;
  const BlurCheck three = CheckBlur(PlaneWith(1.5, 0), options);
  ASSERT_EQ(one.trials.size(), three.trials.size());
  for (std::size_t i = 0; i < one.trials.size(); ++i) {
    EXPECT_EQ(one.trials[i].score, three.trials[i].score);
    EXPECT_EQ(one.trials[i].unexplained, three.trials[i].unexplained);
  }
}

// Four of each pixel: half the size is the same image with half the disparity in px.
EstimateInput Doubled(const EstimateInput& small) {
  EstimateInput large = small;
  large.image = {2 * kW, 2 * kH, 1, {}};
  large.disparity = {2 * kW, 2 * kH, {}, {2, 2}};
  for (int y = 0; y < 2 * kH; ++y) {
    for (int x = 0; x < 2 * kW; ++x) {
      large.image.values.push_back(small.image.at(x / 2, y / 2, 0));
      large.disparity.disparity.push_back(
          small.disparity.disparity[static_cast<std::size_t>(y / 2 * kW + x / 2)]);
    }
  }
  return large;
}

TEST(BlurCheck, LargeImagesAreLookedAtAtHalfTheirSize) {
  const BlurCheck small = CheckBlur(PlaneWith(1, 0.5), {});
  const BlurCheck large = CheckBlur(Doubled(PlaneWith(1, 0.5)), {});
  EXPECT_EQ(small.halvings, 0);
  EXPECT_EQ(large.halvings, 1);
  EXPECT_EQ(large.width_px, kW);
  EXPECT_EQ(large.height_px, kH);
  ASSERT_TRUE(small.other_focus);
  ASSERT_TRUE(large.other_focus);
  EXPECT_EQ(large.other_focus->unexplained, small.other_focus->unexplained);
  EXPECT_DOUBLE_EQ(large.other_focus->focus_offset_px, 2 * small.other_focus->focus_offset_px);
  EXPECT_EQ(large.trials.back().focus_offset_px, 2 * small.trials.back().focus_offset_px);
}

TEST(BlurCheck, AnInputInFocusOrWithoutTextureIsReported) {
  EstimateInput input = Plane();
  std::fill(input.disparity.disparity.begin(), input.disparity.disparity.end(), 0.0F);
  const BlurCheck in_focus = CheckBlur(input, {});
  EXPECT_EQ(in_focus.blocks, 0);
  EXPECT_FALSE(in_focus.narrower_blur);
  EXPECT_THAT(in_focus.message, HasSubstr("no block provides information"));
  std::fill(input.image.values.begin(), input.image.values.end(), 1.0F);
  const BlurCheck white = CheckBlur(input, {});
  EXPECT_THAT(white.trials, SizeIs(0));
  EXPECT_THAT(white.message, HasSubstr("noise"));
}

TEST(BlurCheck, KeepsToTheMemoryLimitInTheMiddle) {
  BlurCheckOptions options;
  options.threads = 1;
  CheckBlur(Plane(), options);  // the first call includes one-time costs
  options.memory_limit_mib = 1;
  EXPECT_THAT(ErrorOf([&] { CheckBlur(Plane(), options); }), HasSubstr("memory_limit_mib is 1"));
  if (testing::kIsSanitized) GTEST_SKIP() << "a sanitizer holds back what was freed";
  int fewest = kH;
  for (double mib = 4; mib < 4000 && fewest == kH; mib *= 1.05) {
    options.memory_limit_mib = mib;
    try {
      fewest = CheckBlur(Plane(), options).height_px;
      break;
    } catch (const std::exception&) {
    }
  }
  EXPECT_LT(fewest, kH);
  EXPECT_GE(fewest, 64);
}

TEST(BlurCheck, ProgressIsReportedAndMayStopIt) {
  BlurCheckOptions options;
  int last = -1, total = 0;
  options.progress = [&](int done, int of) {
    EXPECT_GE(done, last);
    last = done;
    total = of;
  };
  CheckBlur(PlaneWith(1.4, 0), options);
  EXPECT_GT(total, 0);
  EXPECT_EQ(last, total);
  int calls = 0;
  options.progress = [&calls](int, int) {
    if (++calls > 5) throw std::runtime_error("stop");
  };
  EXPECT_THROW(CheckBlur(Plane(), options), std::runtime_error);
  EXPECT_LT(calls, 100);
}

TEST(BlurCheck, RefusesOptionsThatAreNone) {
  BlurCheckOptions options;
  options.threads = -1;
  EXPECT_THAT(ErrorOf([&] { CheckBlur(Plane(), options); }), HasSubstr("threads is -1"));
  options = {};
  options.memory_limit_mib = 0;
  EXPECT_THAT(ErrorOf([&] { CheckBlur(Plane(), options); }), HasSubstr("memory_limit_mib is 0"));
  options = {};
  options.compression_sigma = -0.5;
  EXPECT_THAT(ErrorOf([&] { CheckBlur(Plane(), options); }),
              HasSubstr("compression_sigma is -0.5"));
}

}  // namespace
}  // namespace thicklens::estimator
