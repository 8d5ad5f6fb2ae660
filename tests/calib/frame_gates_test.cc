#include "thicklens/calib/frame_gates.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "drawn_edges.h"
#include "simulated_sweep.h"

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;
using thicklens::testing::DrawnEdge;
using thicklens::testing::StoredBytes;
using thicklens::testing::SweepCase;

cv::Mat Linear(const cv::Mat& stored) {
  cv::Mat linear;
  stored.convertTo(linear, CV_32F, stored.depth() == CV_8U ? 1.0 / 255 : 1.0 / 65535);
  return linear;
}

FrameStatistics Measure(const cv::Mat& stored) { return MeasureFrame(stored, Linear(stored)); }

std::string ReasonFor(const cv::Mat& stored, double median_contrast = 0) {
  return RejectionReason(Measure(stored), median_contrast, {}).value_or("(none)");
}

// A frame of a texture as a camera with 8 bits stores it, near focus.
cv::Mat Leaves(std::uint64_t seed, int bits = 8) {
  model::SweepSimulationOptions options = SweepCase("ii", 192, seed);
  options.frame_count = 1;
  options.first_depth_mm = 300.5;
  options.bits = bits;
  return (*thicklens::testing::Simulate(options).stored)[0];
}

TEST(FrameGates, AGoodFramePasses) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    EXPECT_EQ(ReasonFor(Leaves(seed)), "(none)");
    EXPECT_EQ(ReasonFor(Leaves(seed, 16)), "(none)");
  }
}

TEST(FrameGates, ADarkFrameIsNamedDark) {
  EXPECT_THAT(ReasonFor(cv::Mat::zeros(128, 128, CV_8U)), StartsWith("dark: mean 0.000"));
  // A whole picture, 1/60 as bright.
  cv::Mat dim;
  Leaves(1).convertTo(dim, CV_8U, 1.0 / 60);
  EXPECT_THAT(ReasonFor(dim), StartsWith("dark: "));
}

TEST(FrameGates, SaturationAtFullScaleIsFound) {
  cv::Mat bright;
  Leaves(1).convertTo(bright, CV_8U, 2.2);  // clips at 255
  const FrameStatistics s = Measure(bright);
  EXPECT_GT(s.saturated_fraction, 0.2);
  EXPECT_EQ(s.saturation_level, 255);
  EXPECT_THAT(ReasonFor(bright), HasSubstr("pile up at 255"));
  // The fraction is the clipped one.
  const double clipped = cv::countNonZero(bright == 255) / static_cast<double>(bright.total());
  EXPECT_NEAR(s.saturated_fraction, clipped, 1e-9);
}

TEST(FrameGates, ClippingBelowFullScaleIsFoundByItsPileUp) {
  cv::Mat clipped;
  Leaves(1).convertTo(clipped, CV_8U, 2.2);
  clipped = cv::min(clipped, 243);
  const FrameStatistics s = Measure(clipped);
  EXPECT_EQ(s.saturation_level, 243);
  EXPECT_GT(s.saturated_fraction, 0.2);
  EXPECT_THAT(ReasonFor(clipped), HasSubstr("pile up at 243"));
}

TEST(FrameGates, OneClippedChannelOfThreeIsEnough) {
  const cv::Mat grey = Leaves(1);
  cv::Mat red, colour;
  grey.convertTo(red, CV_8U, 2.2);
  cv::merge(std::vector<cv::Mat>{cv::min(red, 240), grey, grey}, colour);
  cv::Mat linear = Linear(grey);
  const FrameStatistics s = MeasureFrame(colour, linear);
  EXPECT_EQ(s.saturation_level, 240);
  EXPECT_TRUE(RejectionReason(s, 0, {}));
}

TEST(FrameGates, SixteenBitsSaturateAtTheirOwnFullScale) {
  cv::Mat bright;
  Leaves(1, 16).convertTo(bright, CV_16U, 2.2);
  EXPECT_EQ(Measure(bright).saturation_level, 65535);
  EXPECT_THAT(ReasonFor(bright), HasSubstr("pile up at 65535"));
}

TEST(FrameGates, ABrightPlateauWithNoiseIsNoSaturation) {
  // Half of the frame is a white wall at 200 of 255, with noise of 2 grey values.
  for (const double noise_levels : {1.5, 2.0, 4.0}) {
    const cv::Mat plateau = StoredBytes(DrawnEdge(192, 5, 0.8, 0.2, 200.0 / 255), noise_levels, 7);
    EXPECT_EQ(ReasonFor(plateau), "(none)") << noise_levels;
    EXPECT_LT(Measure(plateau).saturated_fraction, 0.05) << noise_levels;
  }
}

// Little noise leaves a bright plateau narrow; it is no clipping all the same.
TEST(FrameGates, ABrightPlateauWithLittleNoiseIsNoSaturation) {
  for (const int bits : {8, 16}) {
    for (const double full_well : {2e4, 1e5, 4e5}) {
      SCOPED_TRACE(::testing::Message() << bits << " bits, full well " << full_well);
      model::SweepSimulationOptions options = SweepCase("ii", 192, 1);
      options.target.kind = model::TargetKind::kKnifeEdge;
      options.frame_count = 1;
      options.first_depth_mm = 300.5;
      options.bits = bits;
      options.full_well_electrons = full_well;
      EXPECT_EQ(ReasonFor((*thicklens::testing::Simulate(options).stored)[0]), "(none)");
    }
  }
}

TEST(FrameGates, AKnifeEdgeWithABlackHalfPasses) {
  EXPECT_EQ(ReasonFor(StoredBytes(DrawnEdge(192, 5, 1, 0, 0.7), 1, 3)), "(none)");
}

TEST(FrameGates, NoiseAloneIsNoTexture) {
  for (const double noise_levels : {2.0, 3.0, 10.0}) {
    const cv::Mat noise = StoredBytes(cv::Mat(192, 192, CV_32F, cv::Scalar(0.4)), noise_levels, 11);
    EXPECT_THAT(ReasonFor(noise), StartsWith("no texture above the noise")) << noise_levels;
  }
}

TEST(FrameGates, NoiseIsMeasuredAsItIs) {
  for (const double noise_levels : {2.0, 5.0}) {
    const cv::Mat noise = StoredBytes(cv::Mat(192, 192, CV_32F, cv::Scalar(0.4)), noise_levels, 12);
    // The 25th percentile of blocks lies a little below their mean; rounding adds 1/12.
    EXPECT_NEAR(Measure(noise).noise_sigma * 255, std::sqrt(noise_levels * noise_levels + 1.0 / 12),
                0.08 * noise_levels);
  }
}

TEST(FrameGates, ABlankFrameIsBlankBesideTheOthers) {
  const FrameStatistics good = Measure(Leaves(1));
  cv::Mat faint;  // a tenth of the contrast at the same brightness
  Leaves(1).convertTo(faint, CV_8U, 0.1, 0.9 * 128);
  const FrameStatistics s = Measure(faint);
  EXPECT_FALSE(RejectionReason(s, 0, {}).value_or("").rfind("blank", 0) == 0);
  EXPECT_LT(s.contrast, 0.25 * good.contrast);
  GateOptions no_noise_gate;
  no_noise_gate.min_gradient_to_noise = 0;
  EXPECT_THAT(RejectionReason(s, good.contrast, no_noise_gate).value_or("(none)"),
              StartsWith("blank: contrast"));
}

TEST(FrameGates, ShadingIsNoContrast) {
  cv::Mat shaded(192, 192, CV_32F);
  for (int y = 0; y < shaded.rows; ++y) {
    for (int x = 0; x < shaded.cols; ++x)
      shaded.at<float>(y, x) = static_cast<float>(0.2 + 0.5 * x / 191.0);
  }
  const FrameStatistics s = Measure(StoredBytes(shaded, 1, 5));
  EXPECT_LT(s.contrast, 0.25 * Measure(Leaves(1)).contrast);
}

}  // namespace
}  // namespace thicklens::calib
