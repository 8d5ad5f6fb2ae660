#include "thicklens/calib/frame_correction.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <opencv2/core.hpp>
#include <string>

#include "support/error_message.h"
#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::thicklens::testing::ErrorOf;

// A polynomial of the place, which no pixel shares with its neighbours.
cv::Mat Ramp(int width, int height, double base, double slope_x, double slope_y) {
  cv::Mat image(height, width, CV_32F);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      image.at<float>(y, x) = static_cast<float>(base + slope_x * x + slope_y * y);
  }
  return image;
}

double WorstDifference(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF); }

TEST(FrameCorrection, UndoesWhatASensorDoesToLight) {
  const cv::Mat scene = Ramp(20, 12, 0.3, 0.004, -0.003);
  const cv::Mat dark = Ramp(20, 12, 0.02, 0.001, 0.002);
  const cv::Mat sensitivity = Ramp(20, 12, 1.2, -0.03, 0.01);
  const double flat_light = 0.5;
  const cv::Mat flat = flat_light * sensitivity + dark;
  const FrameCorrection correction(dark, flat, cv::Mat());
  cv::Mat frame = scene.mul(sensitivity) + dark;
  correction.Apply(0, &frame);
  correction.ReplaceDefects(&frame);
  // The flat is divided by its mean, so that the scene keeps the level of a mean pixel.
  EXPECT_LT(WorstDifference(frame, scene * cv::mean(sensitivity)[0]), 1e-6);
  EXPECT_EQ(correction.defect_count(), 0U);
}

TEST(FrameCorrection, EachChannelOfAFlatHasAMeanOfOne) {
  cv::Mat flat(8, 8, CV_32FC3, cv::Scalar(0.2, 0.4, 0.8));
  flat.at<cv::Vec3f>(0, 0) = {0.1F, 0.4F, 0.8F};
  const FrameCorrection correction(cv::Mat(), flat, cv::Mat());
  EXPECT_EQ(correction.channels(), 3);
  cv::Mat green(8, 8, CV_32F, cv::Scalar(0.25)), red = green.clone();
  correction.Apply(1, &green);
  EXPECT_LT(WorstDifference(green, cv::Mat(8, 8, CV_32F, cv::Scalar(0.25))), 1e-7);
  correction.Apply(0, &red);
  const double mean = (63 * 0.2 + 0.1) / 64;
  EXPECT_NEAR(red.at<float>(0, 0), 0.25 * mean / 0.1, 1e-6);
  EXPECT_NEAR(red.at<float>(3, 3), 0.25 * mean / 0.2, 1e-6);
  EXPECT_THAT(ErrorOf([&] { correction.Apply(3, &red); }), HasSubstr("channel 3"));
}

// The dark does not become positive light: noise around 0 keeps its mean.
TEST(FrameCorrection, LightBelowTheDarkStaysNegative) {
  const FrameCorrection correction(cv::Mat(4, 4, CV_32F, cv::Scalar(0.1)), cv::Mat(), cv::Mat());
  cv::Mat frame(4, 4, CV_32F, cv::Scalar(0.05));
  correction.Apply(0, &frame);
  EXPECT_FLOAT_EQ(frame.at<float>(2, 2), -0.05F);
}

// A plane is a solution of Laplace's equation, and the neighbours of a pixel lie around it evenly.
TEST(FrameCorrection, ASingleDefectOnAPlaneIsReplacedExactly) {
  const cv::Mat plane = Ramp(16, 16, 0.2, 0.01, 0.02);
  cv::Mat defects = cv::Mat::zeros(16, 16, CV_8U), frame = plane.clone();
  defects.at<std::uint8_t>(5, 7) = 1;
  frame.at<float>(5, 7) = std::numeric_limits<float>::infinity();
  const FrameCorrection correction(cv::Mat(), cv::Mat(), defects);
  correction.ReplaceDefects(&frame);
  EXPECT_LT(WorstDifference(frame, plane), 1e-6);
  EXPECT_EQ(correction.defect_count(), 1U);
}

// x^2 - y^2 satisfies Laplace's equation too. Where a speck covers it, the interpolation that the
// weights stand for on a disc has it, within what a disc of pixels differs from one.
TEST(FrameCorrection, ASpeckIsInterpolatedByLaplacesEquation) {
  constexpr int kSize = 41, kMiddle = 20, kRadius = 6;
  cv::Mat saddle(kSize, kSize, CV_32F), defects = cv::Mat::zeros(kSize, kSize, CV_8U);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const int u = x - kMiddle, v = y - kMiddle;
      saddle.at<float>(y, x) = static_cast<float>(u * u - v * v) / (kRadius * kRadius);
      if (u * u + v * v <= kRadius * kRadius) defects.at<std::uint8_t>(y, x) = 255;
    }
  }
  cv::Mat frame = saddle.clone();
  frame.setTo(100, defects);
  FrameCorrection(cv::Mat(), cv::Mat(), defects).ReplaceDefects(&frame);
  // The values of the saddle on the border are -1 to 1.
  EXPECT_LT(WorstDifference(frame, saddle), 0.1);
}

TEST(FrameCorrection, PixelsWithoutFlatLightBecomeDefects) {
  cv::Mat flat(10, 10, CV_32F, cv::Scalar(0.5));
  flat.at<float>(4, 4) = 0;
  flat.at<float>(7, 2) = 0.009F;
  cv::Mat defects = cv::Mat::zeros(10, 10, CV_8U);
  defects.at<std::uint8_t>(7, 2) = 255;
  const FrameCorrection correction(cv::Mat(), flat, defects);
  EXPECT_EQ(correction.defect_count(), 2U);
  EXPECT_EQ(correction.unlit_count(), 1U);
  cv::Mat frame(10, 10, CV_32F, cv::Scalar(0.25));
  frame.at<float>(4, 4) = 0;
  correction.Apply(0, &frame);
  correction.ReplaceDefects(&frame);
  EXPECT_NEAR(frame.at<float>(4, 4), frame.at<float>(0, 0), 1e-6);
}

TEST(FrameCorrection, RefusesWhatDoesNotFit) {
  const cv::Mat light(8, 8, CV_32F, cv::Scalar(0.5)), none;
  EXPECT_THAT(ErrorOf([&] { FrameCorrection(light, cv::Mat(8, 9, CV_32F, cv::Scalar(1)), none); }),
              AllOf(HasSubstr("flat"), HasSubstr("8 x 8"), HasSubstr("9 x 8")));
  EXPECT_THAT(
      ErrorOf([&] { FrameCorrection(light, cv::Mat(8, 8, CV_32FC3, cv::Scalar::all(1)), none); }),
      AllOf(HasSubstr("flat"), HasSubstr("3 channel"), HasSubstr("has 1")));
  EXPECT_THAT(ErrorOf([&] { FrameCorrection(none, cv::Mat(8, 8, CV_8U), none); }),
              HasSubstr("flat: linear light as floats"));
  EXPECT_THAT(ErrorOf([&] { FrameCorrection(light, light, none); }),
              AllOf(HasSubstr("flat: its mean is 0"), HasSubstr("after the dark")));
  cv::Mat infinite = light.clone();
  infinite.at<float>(0, 0) = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(ErrorOf([&] { FrameCorrection(infinite, none, none); }), HasSubstr("finite"));
  cv::Mat most = cv::Mat::zeros(8, 8, CV_8U);
  most.rowRange(0, 5).setTo(255);
  EXPECT_THAT(ErrorOf([&] { FrameCorrection(none, none, most); }),
              AllOf(HasSubstr("40 of 64"), HasSubstr("at most half")));
  cv::Mat other(9, 8, CV_32F, cv::Scalar(0.5));
  EXPECT_THAT(ErrorOf([&] { FrameCorrection(light, none, none).Apply(0, &other); }),
              AllOf(HasSubstr("8 x 9"), HasSubstr("8 x 8")));
}

// A hole that is too wide holds an image that its border does not show.
TEST(FrameCorrection, RefusesAHoleThatIsTooWide) {
  cv::Mat defects = cv::Mat::zeros(200, 200, CV_8U);
  defects(cv::Rect(10, 10, 100, 100)).setTo(255);
  EXPECT_THAT(ErrorOf([&] { FrameCorrection(cv::Mat(), cv::Mat(), defects); }),
              AllOf(HasSubstr("defects"), HasSubstr("32 px")));
}

// ---- in a sweep ----

// A sweep of 8 bits whose corners are two stops darker than its centre.
cv::Mat TwoStops(const cv::Size& size) {
  cv::Mat gain(size, CV_32F);
  const double x0 = 0.5 * (size.width - 1), y0 = 0.5 * (size.height - 1);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const double square = ((x - x0) * (x - x0) + (y - y0) * (y - y0)) / (x0 * x0 + y0 * y0);
      gain.at<float>(y, x) = static_cast<float>(std::pow(1 + square, -2));
    }
  }
  return gain;
}

class CorrectedSweep : public ::testing::Test {
 protected:
  static model::SweepSimulationOptions Options() {
    model::SweepSimulationOptions options = testing::SweepCase("ii", 256, 3);
    options.camera.sensor.transfer = model::TransferCurve::Linear();
    return options;
  }

  testing::SimulatedSweep even_ = testing::Simulate(Options());
};

TEST_F(CorrectedSweep, GreyAndChannelsAreCorrectedAndTheStoredFrameIsNot) {
  FocusSweep sweep = even_.sweep;
  const cv::Mat stored = even_.frame(0);
  const cv::Mat gain = TwoStops(stored.size());
  const cv::Mat plain = LinearGrey(stored, sweep, 0);
  const cv::Mat dark(stored.size(), CV_32F, cv::Scalar(0.01));
  sweep.correction = std::make_shared<const FrameCorrection>(dark, gain + dark, cv::Mat());
  cv::Mat expected = plain - dark;
  cv::divide(expected, gain, expected, cv::mean(gain)[0]);
  EXPECT_LT(WorstDifference(LinearGrey(stored, sweep, 0), expected), 1e-5);
  EXPECT_LT(WorstDifference(LinearChannel(stored, sweep, 0, 0), expected), 1e-5);
  EXPECT_EQ(RegionOf(stored, sweep, 0).data, stored.data);
  sweep.roi = {10, 20, 64, 48};
  EXPECT_LT(WorstDifference(LinearGrey(stored, sweep, 0), expected(cv::Rect(10, 20, 64, 48))),
            1e-5);
}

TEST_F(CorrectedSweep, ACorrectionOfAnotherSizeIsRefusedByTheNameOfTheFrame) {
  FocusSweep sweep = even_.sweep;
  sweep.correction = std::make_shared<const FrameCorrection>(
      cv::Mat(32, 32, CV_32F, cv::Scalar(0.1)), cv::Mat(), cv::Mat());
  EXPECT_THAT(ErrorOf([&] { LinearGrey(even_.frame(2), sweep, 2); }),
              AllOf(HasSubstr("frame-2"), HasSubstr("256 x 256"), HasSubstr("32 x 32")));
}

// The readings of a vignetted sweep bend against its image scale, and its bench offset is found
// from that scale. With the flat, the error of zf is within 1.5 times that of the even sweep.
TEST_F(CorrectedSweep, TheFlatOfAVignettedSweepGivesTheErrorOfAnEvenOne) {
  testing::SimulatedSweep dim = testing::Simulate(Options());
  const cv::Mat gain = TwoStops(dim.frame(0).size());
  for (cv::Mat& frame : *dim.stored) {
    cv::Mat light;
    frame.convertTo(light, CV_32F);
    cv::Mat(light.mul(gain)).convertTo(frame, frame.type());
  }
  const auto calibrated = [](FocusSweep sweep) {
    sweep.offset_mm.reset();
    CalibrationOptions options;
    options.map_field = false;
    return Calibrate(sweep, options);
  };
  const Calibration even = calibrated(even_.sweep);
  dim.sweep.correction = std::make_shared<const FrameCorrection>(cv::Mat(), gain, cv::Mat());
  const Calibration corrected = calibrated(dim.sweep);
  ASSERT_TRUE(even.summary.focus_depth_mm);
  ASSERT_TRUE(corrected.summary.focus_depth_mm);
  const Result& of_even = *even.summary.focus_depth_mm;
  const Result& found = *corrected.summary.focus_depth_mm;
  EXPECT_LT(found.sigma, 1.5 * of_even.sigma);
  EXPECT_NEAR(found.value, even_.truth.focus_depth_mm, 3 * found.sigma);
  dim.sweep.correction.reset();
  const Calibration uncorrected = calibrated(dim.sweep);
  ASSERT_TRUE(uncorrected.summary.focus_depth_mm);
  // Without the flat, the sweep itself shows the shading.
  EXPECT_TRUE(uncorrected.diagnostics.fixed_pattern.shading_removed);
  EXPECT_FALSE(corrected.diagnostics.fixed_pattern.shading_removed);
}

// Pixels that are bright in every frame pull the image scale towards 1 and look like sharp detail.
TEST_F(CorrectedSweep, HotPixelsThatAreReplacedLeaveTheCleanResult) {
  testing::SimulatedSweep hot = testing::Simulate(Options());
  cv::Mat defects = cv::Mat::zeros(hot.frame(0).size(), CV_8U);
  cv::RNG random(5);
  for (int i = 0; i < 200; ++i)
    defects.at<std::uint8_t>(random.uniform(0, defects.rows), random.uniform(0, defects.cols)) =
        255;
  for (cv::Mat& frame : *hot.stored) frame.setTo(frame.depth() == CV_8U ? 230 : 59000, defects);
  CalibrationOptions options;
  options.map_field = false;
  const Calibration clean = Calibrate(even_.sweep, options);
  const Calibration dirty = Calibrate(hot.sweep, options);
  hot.sweep.correction = std::make_shared<const FrameCorrection>(cv::Mat(), cv::Mat(), defects);
  const Calibration corrected = Calibrate(hot.sweep, options);
  ASSERT_TRUE(clean.summary.blur_ratio);
  ASSERT_TRUE(corrected.summary.blur_ratio);
  const Result& kappa = *clean.summary.blur_ratio;
  EXPECT_NEAR(corrected.summary.blur_ratio->value, kappa.value, kappa.sigma);
  EXPECT_LT(corrected.summary.blur_ratio->sigma, 1.3 * kappa.sigma);
  // Uncorrected, the sweep shows them itself, or it is refused or gives another result.
  const bool is_seen = dirty.diagnostics.fixed_pattern.defective_px > 0;
  const bool is_wrong = !dirty.summary.blur_ratio ||
                        std::abs(dirty.summary.blur_ratio->value - kappa.value) > 2 * kappa.sigma;
  EXPECT_TRUE(is_seen || is_wrong);
  EXPECT_EQ(corrected.diagnostics.fixed_pattern.defective_px, 0);
}

}  // namespace
}  // namespace thicklens::calib
