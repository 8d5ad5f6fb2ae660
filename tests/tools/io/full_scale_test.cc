#include "thicklens/io/full_scale.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <random>
#include <string>

#include "support/error_message.h"

namespace thicklens::io {
namespace {

using Kind = FullScaleFinding::Kind;
using ::testing::AllOf;
using testing::ErrorOf;
using ::testing::HasSubstr;

// A frame of grey texture with noise, whole numbers from 0 to `highest`, of which about `clipped`
// of 1 equal `highest`.
cv::Mat Texture(int highest, double clipped = 0) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> value(0, 1);
  cv::Mat frame(200, 300, CV_16U);
  for (int y = 0; y < frame.rows; ++y) {
    for (int x = 0; x < frame.cols; ++x) {
      const bool is_clipped = value(random) < clipped;
      const double level = is_clipped ? highest : std::floor(value(random) * highest);
      frame.at<std::uint16_t>(y, x) = static_cast<std::uint16_t>(level);
    }
  }
  return frame;
}

FullScaleFinding FindingOf(const cv::Mat& frame) {
  ValueCounter values;
  values.Add(frame, "f0.tif");
  return values.Finding();
}

cv::Mat Times(const cv::Mat& frame, double factor) {
  cv::Mat result = frame.clone();
  for (auto value = result.begin<std::uint16_t>(); value != result.end<std::uint16_t>(); ++value)
    *value = static_cast<std::uint16_t>(std::floor(*value * factor));
  return result;
}

TEST(FullScale, ValuesOfSixteenBitsNeedNoOtherFrames) {
  ValueCounter values;
  values.Add(Texture(800), "dark.tif");
  EXPECT_FALSE(values.UsesWholeContainer());
  values.Add(Texture(40000), "bright.tif");
  EXPECT_TRUE(values.UsesWholeContainer());
  EXPECT_EQ(values.Finding().kind, Kind::kContainer);
  EXPECT_EQ(values.Finding().full_scale, 65535);
}

TEST(FullScale, LeftAlignedValuesAreMultiples) {
  for (const int bits : {8, 10, 12, 14}) {
    const FullScaleFinding finding =
        FindingOf(Times(Texture((1 << bits) * 3 / 4), 1 << (16 - bits)));
    EXPECT_EQ(finding.kind, Kind::kLeftAligned) << bits;
    EXPECT_EQ(finding.bits, bits);
    EXPECT_EQ(finding.full_scale, 65536 - (1 << (16 - bits)));
  }
}

TEST(FullScale, ClippedValuesShowTheEndOfRightAlignedOnes) {
  for (const int bits : {8, 10, 12, 14}) {
    const FullScaleFinding finding = FindingOf(Texture((1 << bits) - 1, 0.01));
    EXPECT_EQ(finding.kind, Kind::kRightAligned) << bits;
    EXPECT_EQ(finding.bits, bits);
    EXPECT_EQ(finding.full_scale, (1 << bits) - 1);
    EXPECT_THAT(finding.reason, HasSubstr("f0.tif"));
  }
}

// An under-exposed frame of a camera with 16 bits has the same numbers.
TEST(FullScale, UnclippedDarkValuesAreUndecided) {
  const FullScaleFinding finding = FindingOf(Texture(760));
  EXPECT_EQ(finding.kind, Kind::kUndecided);
  EXPECT_EQ(finding.full_scale, 1023);
  EXPECT_THAT(finding.reason, AllOf(HasSubstr("759 of 65535"), HasSubstr("10 or 12 or 14 bits")));
  EXPECT_EQ(FindingOf(Texture(3000)).full_scale, 4095);
}

TEST(FullScale, ValuesWithGapsWereStretchedToSixteenBits) {
  // 12 bits times 65535/4095, dark.
  const FullScaleFinding finding = FindingOf(Times(Texture(300), 65535.0 / 4095));
  EXPECT_EQ(finding.kind, Kind::kContainer);
  EXPECT_THAT(finding.reason, HasSubstr("16 apart"));
}

TEST(FullScale, AlphaIsLeftOut) {
  cv::Mat frame(200, 300, CV_16UC4, cv::Scalar(0, 0, 0, 65535));
  const cv::Mat grey = Texture(1023, 0.01);
  for (int c = 0; c < 3; ++c) cv::insertChannel(grey, frame, c);
  EXPECT_EQ(FindingOf(frame).kind, Kind::kRightAligned);
}

TEST(FullScale, AFrameOfZerosShowsNothing) {
  EXPECT_EQ(FindingOf(cv::Mat::zeros(20, 20, CV_16U)).kind, Kind::kContainer);
}

TEST(ScaledToContainer, WhiteBecomesFullScale) {
  const cv::Mat frame = (cv::Mat_<std::uint16_t>(1, 3) << 0, 512, 1023);
  const cv::Mat scaled = ScaledToContainer(frame, 1023, "f.tif");
  EXPECT_EQ(scaled.at<std::uint16_t>(0, 0), 0);
  EXPECT_EQ(scaled.at<std::uint16_t>(0, 1), 32800);  // 512 * 65535/1023 = 32799.53
  EXPECT_EQ(scaled.at<std::uint16_t>(0, 2), 65535);
}

TEST(ScaledToContainer, TheContainersOwnFullScaleChangesNothing) {
  const cv::Mat frame = Texture(40000);
  EXPECT_EQ(ScaledToContainer(frame, 65535, "f.tif").data, frame.data);
}

TEST(ScaledToContainer, RefusesValuesAboveWhiteAndImpossibleScales) {
  const cv::Mat frame = (cv::Mat_<std::uint16_t>(1, 1) << 1024);
  EXPECT_THAT(ErrorOf([&] { ScaledToContainer(frame, 1023, "f.tif"); }),
              AllOf(HasSubstr("f.tif"), HasSubstr("1024"), HasSubstr("1023")));
  const cv::Mat narrow(1, 1, CV_8U, cv::Scalar(3));
  EXPECT_THAT(ErrorOf([&] { ScaledToContainer(narrow, 1023, "f.png"); }),
              AllOf(HasSubstr("f.png"), HasSubstr("255"), HasSubstr("1023")));
  EXPECT_THAT(ErrorOf([&] { ScaledToContainer(narrow, 0, "f.png"); }), HasSubstr("found 0"));
}

}  // namespace
}  // namespace thicklens::io
