#include "thicklens/calib/frame_average.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "support/error_message.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::thicklens::testing::ErrorOf;

constexpr double kNoise = 0.01;

// Exposures of an even surface at 0.3 with Gaussian noise.
std::vector<cv::Mat> Exposures(std::size_t count, int type = CV_32F) {
  std::vector<cv::Mat> exposures;
  cv::RNG random(11);
  for (std::size_t i = 0; i < count; ++i) {
    cv::Mat exposure(60, 80, type);
    random.fill(exposure, cv::RNG::NORMAL, cv::Scalar::all(0.3), cv::Scalar::all(kNoise));
    exposures.push_back(exposure);
  }
  return exposures;
}

FrameAverage AverageOf(const std::vector<cv::Mat>& exposures, FrameAveraging method,
                       std::size_t byte_limit = std::size_t{1} << 30) {
  return AverageFrames(
      exposures.size(), [&](std::size_t i) { return exposures[i]; }, method, byte_limit);
}

TEST(FrameAverage, TheMeanIsTheSumOverTheCount) {
  const auto exposures = Exposures(4, CV_32FC3);
  const FrameAverage average = AverageOf(exposures, FrameAveraging::kMean);
  const cv::Mat expected = (exposures[0] + exposures[1] + exposures[2] + exposures[3]) / 4;
  EXPECT_LT(cv::norm(average.light, expected, cv::NORM_INF), 1e-6);
  EXPECT_EQ(average.frames, 4U);
  EXPECT_NEAR(average.mean_level, 0.3, 1e-3);
}

TEST(FrameAverage, TheMedianIsTheMiddleValueOfEachPixel) {
  std::vector<cv::Mat> exposures;
  for (const double value : {0.9, 0.1, 0.3, 0.2})
    exposures.push_back(cv::Mat(3, 3, CV_32F, cv::Scalar(value)));
  EXPECT_NEAR(AverageOf(exposures, FrameAveraging::kMedian).light.at<float>(1, 1), 0.25, 1e-6);
  exposures.resize(3);
  EXPECT_NEAR(AverageOf(exposures, FrameAveraging::kMedian).light.at<float>(1, 1), 0.3, 1e-6);
}

// A cosmic ray in one of eight exposures moves the mean by an eighth of it, and the clipped mean
// not at all; the noise of the clipped mean is that of a mean.
TEST(FrameAverage, TheClippedMeanLeavesOutliersOut) {
  auto exposures = Exposures(8);
  exposures[3].at<float>(10, 20) = 0.9F;
  const FrameAverage mean = AverageOf(exposures, FrameAveraging::kMean);
  const FrameAverage clipped = AverageOf(exposures, FrameAveraging::kClippedMean);
  EXPECT_NEAR(mean.light.at<float>(10, 20), 0.3 + 0.6 / 8, 4 * kNoise / std::sqrt(8));
  EXPECT_NEAR(clipped.light.at<float>(10, 20), 0.3, 4 * kNoise / std::sqrt(7));
  EXPECT_GE(clipped.left_out, 1.0 / (8 * 60 * 80));
  EXPECT_LT(clipped.left_out, 1e-3);
  cv::Scalar level, scatter;
  cv::meanStdDev(clipped.light, level, scatter);
  EXPECT_NEAR(scatter[0], kNoise / std::sqrt(8), 0.05 * kNoise);
}

TEST(FrameAverage, TheNoiseIsThatOfOneExposure) {
  for (const std::size_t count : {1U, 2U, 3U, 16U}) {
    const FrameAverage average = AverageOf(Exposures(count), FrameAveraging::kClippedMean);
    EXPECT_NEAR(average.noise_sigma, kNoise, 0.06 * kNoise) << count;
  }
}

// A pattern that is fixed to the pixels is no noise if there are several exposures.
TEST(FrameAverage, AFixedPatternIsNoNoise) {
  auto exposures = Exposures(6);
  cv::Mat pattern(60, 80, CV_32F);
  cv::RNG(5).fill(pattern, cv::RNG::NORMAL, 0, 5 * kNoise);
  for (cv::Mat& exposure : exposures) exposure += pattern;
  EXPECT_NEAR(AverageOf(exposures, FrameAveraging::kMedian).noise_sigma, kNoise, 0.06 * kNoise);
}

// Values of 8 bits whose noise is a third of a step: most pixels do not vary. The mean keeps what
// lies between the steps, and values that differ by one step are no outliers.
TEST(FrameAverage, NoiseBelowTheStepsOfTheValuesIsKept) {
  std::vector<cv::Mat> exposures;
  cv::RNG random(4);
  for (int i = 0; i < 8; ++i) {
    cv::Mat light(60, 80, CV_32F), stored;
    random.fill(light, cv::RNG::NORMAL, 100.3, 0.3);
    light.convertTo(stored, CV_8U);
    stored.convertTo(light, CV_32F, 1.0 / 255);
    exposures.push_back(light);
  }
  const FrameAverage average = AverageOf(exposures, FrameAveraging::kClippedMean);
  EXPECT_GT(average.noise_sigma, 0.2 / 255);
  EXPECT_LT(average.noise_sigma, 0.6 / 255);
  EXPECT_NEAR(average.mean_level, AverageOf(exposures, FrameAveraging::kMean).mean_level,
              0.01 / 255);
}

TEST(FrameAverage, ALimitOfMemoryChangesNothing) {
  const auto exposures = Exposures(5);
  for (const auto method : {FrameAveraging::kMedian, FrameAveraging::kClippedMean}) {
    const cv::Mat all = AverageOf(exposures, method).light;
    EXPECT_EQ(cv::norm(all, AverageOf(exposures, method, 7 * 80 * 4 * 5).light, cv::NORM_INF), 0);
    EXPECT_EQ(cv::norm(all, AverageOf(exposures, method, 1).light, cv::NORM_INF), 0);
  }
}

TEST(FrameAverage, RefusesNothingAndUnequalExposures) {
  EXPECT_THAT(ErrorOf([] { AverageOf({}, FrameAveraging::kMean); }), HasSubstr("at least one"));
  auto exposures = Exposures(3);
  exposures[2] = cv::Mat(60, 81, CV_32F, cv::Scalar(0));
  EXPECT_THAT(ErrorOf([&] { AverageOf(exposures, FrameAveraging::kMean); }),
              AllOf(HasSubstr("exposure 2"), HasSubstr("80 x 60"), HasSubstr("81 x 60")));
  exposures[2] = cv::Mat(60, 80, CV_8U, cv::Scalar(0));
  EXPECT_THAT(ErrorOf([&] { AverageOf(exposures, FrameAveraging::kMean); }),
              AllOf(HasSubstr("exposure 2"), HasSubstr("floats")));
}

// ---- defects ----

TEST(Defects, AreFoundWhereTheyWerePut) {
  cv::Mat dark = AverageOf(Exposures(8), FrameAveraging::kMean).light - 0.28;
  cv::Mat flat = AverageOf(Exposures(9), FrameAveraging::kMean).light + 0.2;
  flat += dark;
  cv::Mat expected = cv::Mat::zeros(dark.size(), CV_8U);
  for (const cv::Point& place : {cv::Point(0, 0), cv::Point(40, 30), cv::Point(41, 30)}) {
    dark.at<float>(place) += 0.1F;
    flat.at<float>(place) += 0.1F;
    expected.at<std::uint8_t>(place) = 255;
  }
  for (const cv::Point& place : {cv::Point(79, 59), cv::Point(10, 50)}) {
    flat.at<float>(place) *= 0.6F;
    expected.at<std::uint8_t>(place) = 255;
  }
  flat.at<float>(20, 60) *= 1.5F;
  expected.at<std::uint8_t>(20, 60) = 255;
  const Defects found = FindDefects(dark, flat);
  EXPECT_EQ(found.hot, 3U);
  EXPECT_EQ(found.dead, 3U);
  EXPECT_EQ(cv::countNonZero(found.mask != expected), 0);
  EXPECT_EQ(FindDefects(dark, cv::Mat()).hot, 3U);
  EXPECT_EQ(FindDefects(cv::Mat(), flat).dead, 3U);
}

// Noise alone has hardly a value beyond 8 standard deviations.
TEST(Defects, NoiseHasNone) {
  DefectOptions options;
  options.least_hot = 1e-9;
  const Defects found = FindDefects(Exposures(1)[0], cv::Mat(), options);
  EXPECT_EQ(found.hot, 0U);
  EXPECT_EQ(found.dead, 0U);
}

TEST(Defects, RefuseWrongOptionsAndImages) {
  const cv::Mat dark = Exposures(1)[0];
  EXPECT_THAT(ErrorOf([] { FindDefects(cv::Mat(), cv::Mat()); }), HasSubstr("a dark or a flat"));
  EXPECT_THAT(ErrorOf([&] { FindDefects(dark, cv::Mat(9, 9, CV_32F)); }), HasSubstr("one size"));
  DefectOptions options;
  options.flat_deviation = 1;
  EXPECT_THAT(ErrorOf([&] { FindDefects(dark, cv::Mat(), options); }),
              HasSubstr("flat_deviation is 1"));
  options = {};
  options.hot_sigmas = std::nan("");
  EXPECT_THAT(ErrorOf([&] { FindDefects(dark, cv::Mat(), options); }), HasSubstr("hot_sigmas"));
}

// ---- the structure of a flat ----

// Two stops of shading from the centre to the corners, with noise and a speck of dust.
cv::Mat ShadedFlat(double noise) {
  cv::Mat flat(240, 320, CV_32F);
  cv::RNG random(3);
  for (int y = 0; y < flat.rows; ++y) {
    for (int x = 0; x < flat.cols; ++x) {
      const double square = (std::pow(x - 160, 2) + std::pow(y - 120, 2)) / (200.0 * 200.0);
      flat.at<float>(y, x) =
          static_cast<float>(0.6 / std::pow(1 + square, 2) + random.gaussian(noise));
    }
  }
  cv::circle(flat, {90, 70}, 6, cv::Scalar(0.3), -1);
  return flat;
}

TEST(StructureOfAFlat, ShadingDustAndNoiseAreNone) {
  for (const double noise : {0.001, 0.006, 0.03}) {
    const FlatStructure found = StructureOf(ShadedFlat(noise));
    EXPECT_LT(found.relative, std::max(0.004, 1.5 * found.of_noise)) << noise;
    EXPECT_NEAR(found.of_noise, noise / cv::mean(ShadedFlat(0))[0] / 4, 0.1 * noise) << noise;
  }
}

// Stripes of 5 % and a period of 12 px are far above the noise.
TEST(StructureOfAFlat, ATargetIs) {
  cv::Mat flat = ShadedFlat(0.006);
  for (int x = 0; x < flat.cols; ++x) flat.col(x) *= 1 + 0.05 * std::sin(2 * CV_PI * x / 12);
  const FlatStructure found = StructureOf(flat);
  EXPECT_GT(found.relative, 0.02);
  EXPECT_GT(found.relative, 3 * found.of_noise);
}

}  // namespace
}  // namespace thicklens::calib
