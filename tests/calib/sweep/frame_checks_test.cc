#include "thicklens/calib/frame_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <vector>

#include "tests/calib/drawn_edges.h"
#include "tests/calib/simulated_sweep.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using thicklens::testing::DrawnEdge;
using thicklens::testing::EncodedBytes;
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

// A frame of a texture near focus, as a camera with 8 bits stores it.
cv::Mat Leaves(std::uint64_t seed, int bits = 8) {
  model::SweepSimulationOptions options = SweepCase("ii", 192, seed);
  options.frame_count = 1;
  options.first_depth_mm = 300.5;
  options.bits = bits;
  return (*thicklens::testing::Simulate(options).stored)[0];
}

TEST(FrameChecks, AGoodFramePasses) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    EXPECT_EQ(ReasonFor(Leaves(seed)), "(none)");
    EXPECT_EQ(ReasonFor(Leaves(seed, 16)), "(none)");
  }
}

TEST(FrameChecks, ADarkFrameIsNamedDark) {
  EXPECT_THAT(ReasonFor(cv::Mat::zeros(128, 128, CV_8U)), StartsWith("dark: the mean is 0.000"));
  // A whole image that is 1/60 as bright.
  cv::Mat dim;
  Leaves(1).convertTo(dim, CV_8U, 1.0 / 60);
  EXPECT_THAT(ReasonFor(dim), StartsWith("dark: "));
}

TEST(FrameChecks, SaturationAtFullScaleIsFound) {
  cv::Mat bright;
  Leaves(1).convertTo(bright, CV_8U, 2.2);  // clips at 255
  const FrameStatistics s = Measure(bright);
  EXPECT_GT(s.saturated_fraction, 0.2);
  EXPECT_EQ(s.saturation_level, 255);
  EXPECT_THAT(ReasonFor(bright), HasSubstr("are clipped at 255"));
  // The reported fraction is the clipped one.
  const double clipped = cv::countNonZero(bright == 255) / static_cast<double>(bright.total());
  EXPECT_NEAR(s.saturated_fraction, clipped, 1e-9);
}

TEST(FrameChecks, ClippingBelowFullScaleIsDetected) {
  cv::Mat clipped;
  Leaves(1).convertTo(clipped, CV_8U, 2.2);
  clipped = cv::min(clipped, 243);
  const FrameStatistics s = Measure(clipped);
  EXPECT_EQ(s.saturation_level, 243);
  EXPECT_GT(s.saturated_fraction, 0.2);
  EXPECT_THAT(ReasonFor(clipped), HasSubstr("are clipped at 243"));
}

TEST(FrameChecks, OneClippedChannelOfThreeIsEnough) {
  const cv::Mat grey = Leaves(1);
  cv::Mat red, colour;
  grey.convertTo(red, CV_8U, 2.2);
  cv::merge(std::vector<cv::Mat>{cv::min(red, 240), grey, grey}, colour);
  cv::Mat linear = Linear(grey);
  const FrameStatistics s = MeasureFrame(colour, linear);
  EXPECT_EQ(s.saturation_level, 240);
  EXPECT_TRUE(RejectionReason(s, 0, {}));
}

TEST(FrameChecks, SixteenBitsSaturateAtTheirOwnFullScale) {
  cv::Mat bright;
  Leaves(1, 16).convertTo(bright, CV_16U, 2.2);
  EXPECT_EQ(Measure(bright).saturation_level, 65535);
  EXPECT_THAT(ReasonFor(bright), HasSubstr("are clipped at 65535"));
}

TEST(FrameChecks, ABrightPlateauWithNoiseIsNoSaturation) {
  // Half of the frame is a white wall at 200 of 255, with noise of 2 grey values.
  for (const double noise_levels : {1.5, 2.0, 4.0}) {
    const cv::Mat plateau = EncodedBytes(DrawnEdge(192, 5, 0.8, 0.2, 200.0 / 255), noise_levels, 7);
    EXPECT_EQ(ReasonFor(plateau), "(none)") << noise_levels;
    EXPECT_LT(Measure(plateau).saturated_fraction, 0.05) << noise_levels;
  }
}

// A bright plateau with little noise is narrow in the histogram. It is not clipped nevertheless.
TEST(FrameChecks, ABrightPlateauWithLittleNoiseIsNoSaturation) {
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

TEST(FrameChecks, AKnifeEdgeWithABlackHalfPasses) {
  EXPECT_EQ(ReasonFor(EncodedBytes(DrawnEdge(192, 5, 1, 0, 0.7), 1, 3)), "(none)");
}

TEST(FrameChecks, NoiseAloneIsNoTexture) {
  for (const double noise_levels : {2.0, 3.0, 10.0}) {
    const cv::Mat noise =
        EncodedBytes(cv::Mat(192, 192, CV_32F, cv::Scalar(0.4)), noise_levels, 11);
    EXPECT_THAT(ReasonFor(noise), StartsWith("no texture above the noise")) << noise_levels;
  }
}

TEST(FrameChecks, NoiseIsMeasuredAsItIs) {
  for (const double noise_levels : {2.0, 5.0}) {
    const cv::Mat noise =
        EncodedBytes(cv::Mat(192, 192, CV_32F, cv::Scalar(0.4)), noise_levels, 12);
    // The 25th percentile of blocks is a little below their mean; rounding adds 1/12.
    EXPECT_NEAR(Measure(noise).noise_sigma * 255, std::sqrt(noise_levels * noise_levels + 1.0 / 12),
                0.08 * noise_levels);
  }
}

TEST(FrameChecks, ABlankFrameIsBlankBesideTheOthers) {
  const FrameStatistics good = Measure(Leaves(1));
  cv::Mat faint;  // a tenth of the contrast at the same brightness
  Leaves(1).convertTo(faint, CV_8U, 0.1, 0.9 * 128);
  const FrameStatistics s = Measure(faint);
  EXPECT_FALSE(RejectionReason(s, 0, {}).value_or("").rfind("blank", 0) == 0);
  EXPECT_LT(s.contrast, 0.25 * good.contrast);
  QualityCheckOptions no_noise_check;
  no_noise_check.min_gradient_to_noise = 0;
  EXPECT_THAT(RejectionReason(s, good.contrast, no_noise_check).value_or("(none)"),
              StartsWith("blank: the contrast is"));
}

TEST(FrameChecks, ShadingIsNoContrast) {
  cv::Mat shaded(192, 192, CV_32F);
  for (int y = 0; y < shaded.rows; ++y) {
    for (int x = 0; x < shaded.cols; ++x)
      shaded.at<float>(y, x) = static_cast<float>(0.2 + 0.5 * x / 191.0);
  }
  const FrameStatistics s = Measure(EncodedBytes(shaded, 1, 5));
  EXPECT_LT(s.contrast, 0.25 * Measure(Leaves(1)).contrast);
}

// A texture from which `black` is subtracted before it is stored, as if the black level were set
// too high.
cv::Mat Underexposed(std::uint64_t seed, double black, int depth = CV_8U) {
  cv::Mat dark;
  Leaves(seed, depth == CV_8U ? 8 : 16).convertTo(dark, depth, 1.6, -black);
  return dark;
}

TEST(FrameChecks, ATextureClippedAtBlackIsNamedBlack) {
  const cv::Mat dark = Underexposed(1, 150);
  const FrameStatistics s = Measure(dark);
  const double clipped = cv::countNonZero(dark == 0) / static_cast<double>(dark.total());
  ASSERT_GT(clipped, 0.1);
  ASSERT_LT(clipped, 0.6);
  EXPECT_NEAR(s.black_fraction, clipped, 1e-9);
  EXPECT_EQ(s.black_level, 0);
  EXPECT_FALSE(s.black_is_one_side);
  EXPECT_THAT(ReasonFor(dark), AllOf(StartsWith("black: "), HasSubstr("are clipped at 0,")));
  EXPECT_THAT(ReasonFor(Underexposed(1, 150 * 257, CV_16U)), StartsWith("black: "));
  // The frame may be accepted if the target is stated to be an edge.
  QualityCheckOptions edge;
  edge.edge_target = true;
  EXPECT_FALSE(RejectionReason(s, 0, edge));
}

TEST(FrameChecks, ClippingAboveZeroAtTheDarkEndIsDetected) {
  const cv::Mat dark = cv::max(Underexposed(2, 150), 12);
  const FrameStatistics s = Measure(dark);
  EXPECT_EQ(s.black_level, 12);
  EXPECT_GT(s.black_fraction, 0.05);
  EXPECT_THAT(ReasonFor(dark), HasSubstr("are clipped at 12,"));
}

TEST(FrameChecks, AFewBlackPixelsDoNoHarm) {
  cv::Mat specks = Leaves(1);
  for (int y = 0; y < specks.rows; ++y) specks.at<std::uint8_t>(y, y * 7 % specks.cols) = 0;
  EXPECT_EQ(ReasonFor(specks), "(none)");
  EXPECT_NEAR(Measure(specks).black_fraction, 1.0 / specks.cols, 1e-3);
}

TEST(FrameChecks, AGoodFrameHasNoBlackAndADarkPlateauWithNoiseIsNone) {
  for (const std::uint64_t seed : {1U, 2U, 3U})
    EXPECT_LT(Measure(Leaves(seed)).black_fraction, 0.001);
  for (const double noise_levels : {1.5, 2.0, 4.0}) {
    const cv::Mat plateau = EncodedBytes(DrawnEdge(192, 5, 0.8, 30.0 / 255, 0.7), noise_levels, 7);
    EXPECT_LT(Measure(plateau).black_fraction, 0.05) << noise_levels;
    EXPECT_EQ(ReasonFor(plateau), "(none)") << noise_levels;
  }
}

TEST(FrameChecks, PlateausOfLittleNoiseAreClippedAtNeitherEnd) {
  // The plateaus may be anywhere between two encoded values.
  for (const double noise_levels : {0.3, 0.45, 0.55, 0.7, 1.0}) {
    for (const double part : {0.0, 0.1, 0.3, 0.5, 0.6, 0.9}) {
      const cv::Mat edge = DrawnEdge(192, 5, 1, (40 + part) / 255, (180 + part) / 255);
      const FrameStatistics s = Measure(EncodedBytes(edge, noise_levels, 3));
      EXPECT_LT(s.black_fraction, 0.05) << noise_levels << " " << part;
      EXPECT_LT(s.saturated_fraction, 0.05) << noise_levels << " " << part;
    }
  }
}

TEST(FrameChecks, ABacklitEdgeIsBlackOnOneSideInEveryDirection) {
  for (const double angle_deg : {0.0, 5.0, 40.0, 90.0, 175.0, 265.0}) {
    for (const double noise_levels : {0.0, 0.7, 2.0}) {
      const cv::Mat edge = EncodedBytes(DrawnEdge(192, angle_deg, 2, 0, 0.7), noise_levels, 3);
      const FrameStatistics s = Measure(edge);
      EXPECT_GT(s.black_fraction, 0.2) << angle_deg;
      EXPECT_TRUE(s.black_is_one_side) << angle_deg << " " << noise_levels;
      EXPECT_EQ(ReasonFor(edge), "(none)") << angle_deg << " " << noise_levels;
    }
  }
}

TEST(FrameChecks, BlackOnBothSidesIsNoEdge) {
  // A slit: the middle third is lit.
  cv::Mat slit = cv::Mat::zeros(192, 192, CV_8U);
  slit.colRange(64, 128).setTo(180);
  EXPECT_FALSE(Measure(slit).black_is_one_side);
  EXPECT_THAT(ReasonFor(slit), StartsWith("black: 67 % of the pixels are clipped at 0,"));
}

TEST(FrameChecks, ScatteredBlackIsNoEdgeWhereverItGathers) {
  // The frames have specks everywhere, specks in one half only, or are black except for a corner.
  std::mt19937 random(9);
  cv::Mat all(192, 192, CV_8U, cv::Scalar(120)), half = all.clone(),
                                                 corner = cv::Mat::zeros(192, 192, CV_8U);
  for (int i = 0; i < 192 * 192 / 2; ++i) {
    const int x = static_cast<int>(random() % 192), y = static_cast<int>(random() % 192);
    all.at<std::uint8_t>(y, x) = 0;
    if (x < 96 && i % 2 == 0) half.at<std::uint8_t>(y, x) = 0;
  }
  corner(cv::Rect(0, 0, 60, 60)).setTo(120);
  for (const cv::Mat& frame : {all, half, corner}) {
    const FrameStatistics s = Measure(frame);
    EXPECT_GT(s.black_fraction, 0.05);
    EXPECT_FALSE(s.black_is_one_side);
  }
}

// A grey image behind a colour filter of 2 x 2 px.
cv::Mat Mosaic(const cv::Mat& grey, double red, double green, double blue) {
  cv::Mat mosaic = grey.clone();
  const double gain[2][2] = {{red, green}, {green, blue}};
  for (int y = 0; y < grey.rows; ++y) {
    for (int x = 0; x < grey.cols; ++x) {
      const double value = grey.at<std::uint8_t>(y, x) * gain[y % 2][x % 2];
      mosaic.at<std::uint8_t>(y, x) = cv::saturate_cast<std::uint8_t>(value);
    }
  }
  return mosaic;
}

TEST(FrameChecks, ARawMosaicGetsTheAdviceToDevelopIt) {
  const cv::Mat leaves = Leaves(1);
  for (const cv::Mat& mosaic :
       {Mosaic(leaves, 0.5, 1, 0.6), Mosaic(leaves, 1, 0.9, 1), Mosaic(leaves, 0.9, 1, 1)}) {
    EXPECT_TRUE(Measure(mosaic).is_mosaic);
    EXPECT_THAT(ReasonFor(mosaic), StartsWith("raw mosaic: develop it first"));
  }
  // This works for a knife edge, too, one half of which is uninformative.
  const cv::Mat edge = EncodedBytes(DrawnEdge(192, 5, 1, 0, 0.7), 1, 3);
  EXPECT_TRUE(Measure(Mosaic(edge, 0.5, 1, 0.6)).is_mosaic);
  cv::Mat words;
  Mosaic(leaves, 0.5, 1, 0.6).convertTo(words, CV_16U, 257);
  EXPECT_TRUE(Measure(words).is_mosaic);
}

TEST(FrameChecks, TexturesNoiseAndSmallGainsAreNoMosaic) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) EXPECT_FALSE(Measure(Leaves(seed)).is_mosaic);
  EXPECT_FALSE(Measure(Mosaic(Leaves(1), 0.99, 1, 1)).is_mosaic);
  const cv::Mat plain = EncodedBytes(cv::Mat(192, 192, CV_32F, cv::Scalar(0.5)), 1, 8);
  EXPECT_FALSE(Measure(Mosaic(plain, 0.98, 1, 1)).is_mosaic);
  // A part of the frame with a period of 2 px is a texture, whatever the size of the part.
  cv::Mat part = plain.clone();
  const cv::Rect most(0, 0, 192, 128);
  Mosaic(plain(most), 0.7, 1, 0.7).copyTo(part(most));
  EXPECT_FALSE(Measure(part).is_mosaic);
  // White noise of the whole range, and squares of a few pixels.
  std::mt19937 random(5);
  cv::Mat noise(192, 192, CV_8U), squares(192, 192, CV_8U);
  for (int y = 0; y < noise.rows; ++y) {
    for (int x = 0; x < noise.cols; ++x) {
      noise.at<std::uint8_t>(y, x) = static_cast<std::uint8_t>(random() % 256);
      squares.at<std::uint8_t>(y, x) = (x / 3 + y / 3) % 2 == 0 ? 40 : 200;
    }
  }
  // The squares are blurred as by a lens, because a part of the power of drawn squares is at
  // exactly half a cycle per pixel.
  cv::GaussianBlur(squares, squares, {}, 0.6);
  EXPECT_FALSE(Measure(noise).is_mosaic);
  EXPECT_FALSE(Measure(squares).is_mosaic);
  // These pixels, developed to three channels, are an image and no mosaic.
  const cv::Mat mosaic = Mosaic(Leaves(1), 0.5, 1, 0.6);
  cv::Mat colour;
  cv::merge(std::vector<cv::Mat>{mosaic, mosaic, mosaic}, colour);
  EXPECT_FALSE(MeasureFrame(colour, Linear(mosaic)).is_mosaic);
}

TEST(FrameChecks, TheHashDistinguishesImagesByEveryPixel) {
  const cv::Mat leaves = Leaves(1)(cv::Rect(0, 0, 189, 190)).clone();  // no multiple of 8 bytes
  const auto hash = [](const cv::Mat& stored) { return Measure(stored).content_hash; };
  EXPECT_EQ(hash(leaves), hash(leaves.clone()));
  // The fingerprint depends on the pixels, not on their layout in memory.
  cv::Mat larger;
  cv::copyMakeBorder(leaves, larger, 3, 3, 3, 3, cv::BORDER_CONSTANT, 17);
  EXPECT_EQ(hash(larger(cv::Rect(3, 3, 189, 190))), hash(leaves));
  for (const cv::Point at : {cv::Point(0, 0), cv::Point(188, 189), cv::Point(188, 0),
                             cv::Point(94, 95), cv::Point(187, 50)}) {
    cv::Mat changed = leaves.clone();
    changed.at<std::uint8_t>(at) ^= 1;
    EXPECT_NE(hash(changed), hash(leaves)) << at;
  }
  EXPECT_NE(hash(leaves), hash(Leaves(2)(cv::Rect(0, 0, 189, 190))));
  EXPECT_NE(hash(cv::Mat(64, 32, CV_8U, cv::Scalar(9))),
            hash(cv::Mat(32, 64, CV_8U, cv::Scalar(9))));
  cv::Mat swapped = leaves.clone();  // two rows are exchanged
  leaves.row(10).copyTo(swapped.row(20));
  leaves.row(20).copyTo(swapped.row(10));
  EXPECT_NE(hash(swapped), hash(leaves));
}

TEST(FrameChecks, ContrastLeavesOutWhatAWideGaussianKeeps) {
  // The result is compared with the plain definition on a frame that is large enough to be reduced:
  // widths of 400/25 and 700/25 px, and sizes that are not multiples of a block.
  for (const cv::Size size : {cv::Size(611, 401), cv::Size(702, 777)}) {
    cv::Mat grey(size, CV_32F);
    std::mt19937 random(3);
    cv::randu(grey, 0.1, 0.9);
    cv::GaussianBlur(grey, grey, {}, 2);
    for (int x = 0; x < grey.cols; ++x) grey.col(x) += 0.3 * std::sin(x / 60.0) + (x > 300) * 0.2;
    cv::Mat fine, wide;
    cv::GaussianBlur(grey, fine, cv::Size(11, 11), 1, 1, cv::BORDER_REFLECT_101);
    const double sigma_px = std::min(size.width, size.height) / 25.0;
    const int taps = 2 * static_cast<int>(std::ceil(5 * sigma_px)) + 1;
    cv::GaussianBlur(grey, wide, cv::Size(taps, taps), sigma_px, sigma_px, cv::BORDER_REFLECT_101);
    cv::Scalar mean, deviation;
    cv::meanStdDev(fine - wide, mean, deviation);
    cv::Mat stored;
    grey.convertTo(stored, CV_8U, 255);
    const double contrast = MeasureFrame(stored, grey).contrast;
    EXPECT_NEAR(contrast * cv::mean(grey)[0] / deviation[0], 1, 2e-4);
  }
}

}  // namespace
}  // namespace thicklens::calib
