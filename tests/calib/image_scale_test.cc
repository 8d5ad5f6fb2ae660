#include "thicklens/calib/image_scale.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "simulated_sweep.h"

namespace thicklens::calib {
namespace {

using model::BenchDirection;
using ::testing::HasSubstr;
using thicklens::testing::SweepCase;

// 360 to 440 mm in steps of 10 mm, 400 mm in the middle, without drift or with some.
std::vector<cv::Mat> Frames(std::uint64_t seed, double drift_sigma_px) {
  model::SweepSimulationOptions options = SweepCase("iii", 256, seed);
  options.drift_sigma_px = drift_sigma_px;
  options.first_depth_mm = 360;
  options.step_mm = 10;
  options.frame_count = 9;
  const auto rendered = thicklens::testing::Simulate(options);
  std::vector<cv::Mat> frames;
  for (std::size_t i = 0; i < rendered.stored->size(); ++i)
    frames.push_back(LinearGrey((*rendered.stored)[i], rendered.sweep, i));
  return frames;
}
constexpr std::size_t kMiddle = 4;
double TrueScale(std::size_t frame) { return 400 / (360 + 10 * static_cast<double>(frame)); }

TEST(RegisterScale, FindsTheScaleOfARenderedFrame) {
  for (const std::uint64_t seed : {1U, 2U}) {
    const auto frames = Frames(seed, 1.5);  // the target moves sideways
    for (std::size_t i = 0; i < frames.size(); ++i) {
      if (i == kMiddle) continue;
      // Started 1 % off.
      const auto scale = RegisterScale(frames[kMiddle], frames[i], TrueScale(i) * 1.01);
      ASSERT_TRUE(scale) << i;
      EXPECT_NEAR(*scale, TrueScale(i), 1e-3) << "frame " << i;
    }
  }
}

TEST(RegisterScale, ALampThatChangesDoesNotMatter) {
  const auto frames = Frames(3, 0);
  const auto scale = RegisterScale(frames[kMiddle], 0.4 * frames[6] + 0.05, TrueScale(6));
  ASSERT_TRUE(scale);
  EXPECT_NEAR(*scale, TrueScale(6), 1e-3);
}

TEST(RegisterScale, RejectsAnUnrelatedPicture) {
  std::vector<cv::Mat> pictures;
  for (std::uint64_t seed = 10; seed < 15; ++seed) pictures.push_back(Frames(seed, 0)[kMiddle]);
  for (const cv::Mat& reference : pictures) {
    for (const cv::Mat& frame : pictures) {
      EXPECT_EQ(RegisterScale(reference, frame, 1).has_value(), reference.data == frame.data);
    }
  }
}

TEST(RegisterScale, RejectsAPictureStretchedOneWay) {
  const cv::Mat reference = Frames(4, 0)[kMiddle];
  cv::Mat stretched;
  cv::warpAffine(reference, stretched, cv::Matx23d(1.04, 0, -5, 0, 1, 0), reference.size(),
                 cv::INTER_CUBIC, cv::BORDER_REFLECT);
  EXPECT_FALSE(RegisterScale(reference, stretched, 1.02));
}

// 1/scale = (offset + sign reading)/z_reference, with errors of the readings.
std::vector<ScaleSample> Samples(double offset_mm, BenchDirection direction, int count,
                                 double reading_sigma_mm, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 1);
  const double sign = model::DirectionSign(direction);
  std::vector<ScaleSample> samples;
  for (int i = 0; i < count; ++i) {
    const double depth_mm = 340 + 120.0 * i / (count - 1);
    const double reading_mm = sign * (depth_mm - offset_mm);
    samples.push_back({static_cast<std::size_t>(i), reading_mm + reading_sigma_mm * noise(random),
                       400 / depth_mm});
  }
  return samples;
}

TEST(FitScaleLaw, IsExactOnExactSamplesInBothDirections) {
  for (const BenchDirection direction : {BenchDirection::kAway, BenchDirection::kToward}) {
    for (const double offset_mm : {-37.5, 0.0, 106.5}) {
      const ScaleLaw law = FitScaleLaw(Samples(offset_mm, direction, 21, 0, 1), 10, 0, direction);
      ASSERT_TRUE(law.done) << law.message;
      EXPECT_NEAR(law.offset_mm.value, offset_mm, 1e-9);
      EXPECT_NEAR(law.reference_depth_mm, 400, 1e-9);
      EXPECT_EQ(law.frames_used, 21);
      EXPECT_LT(law.reading_rms_mm, 1e-9);
    }
  }
}

TEST(FitScaleLaw, SigmaCoversTheScatter) {
  constexpr int kRuns = 200;
  double sum = 0, squares = 0, stated = 0;
  for (int run = 0; run < kRuns; ++run) {
    const ScaleLaw law =
        FitScaleLaw(Samples(20, BenchDirection::kAway, 31, 0.07, 50U + static_cast<unsigned>(run)),
                    15, 0.07, BenchDirection::kAway);
    ASSERT_TRUE(law.done);
    sum += (law.offset_mm.value - 20) / kRuns;
    squares += std::pow(law.offset_mm.value - 20, 2) / kRuns;
    stated += law.offset_mm.sigma / kRuns;
  }
  const double scatter_mm = std::sqrt(squares - sum * sum);
  EXPECT_LT(std::abs(sum), 3 * scatter_mm / std::sqrt(kRuns));
  EXPECT_GT(stated, 0.8 * scatter_mm);
  // The jackknife over blocks allows for errors that neighbours share; these samples have none.
  EXPECT_LT(stated, 5 * scatter_mm);
}

TEST(FitScaleLaw, AFewWrongReadingsDoNotMoveIt) {
  auto samples = Samples(20, BenchDirection::kAway, 31, 0.05, 9);
  const ScaleLaw clean = FitScaleLaw(samples, 15, 0.05, BenchDirection::kAway);
  samples[3].reading_mm += 10;
  samples[27].reading_mm -= 15;
  std::swap(samples[10].reading_mm, samples[14].reading_mm);
  const ScaleLaw law = FitScaleLaw(samples, 15, 0.05, BenchDirection::kAway);
  ASSERT_TRUE(law.done);
  EXPECT_NEAR(law.offset_mm.value, clean.offset_mm.value, clean.offset_mm.sigma);
  EXPECT_EQ(law.frames_used, 27);
}

TEST(FitScaleLaw, RefusesAConstantScale) {
  auto samples = Samples(0, BenchDirection::kAway, 21, 0, 1);
  std::mt19937 random(2);
  std::normal_distribution<double> noise(1, 2e-5);
  for (ScaleSample& s : samples) s.scale = noise(random);
  const ScaleLaw law = FitScaleLaw(samples, 10, 0.05, BenchDirection::kAway);
  EXPECT_FALSE(law.done);
  EXPECT_THAT(law.message, HasSubstr("does not change with the reading"));
}

TEST(FitScaleLaw, RefusesAReversedScaleAndNamesTheDirection) {
  const ScaleLaw away = FitScaleLaw(Samples(700, BenchDirection::kToward, 21, 0.05, 1), 10, 0.05,
                                    BenchDirection::kAway);
  EXPECT_FALSE(away.done);
  EXPECT_THAT(away.message, HasSubstr("direction must be 'toward', not 'away'"));
  const ScaleLaw toward = FitScaleLaw(Samples(0, BenchDirection::kAway, 21, 0.05, 1), 10, 0.05,
                                      BenchDirection::kToward);
  EXPECT_FALSE(toward.done);
  EXPECT_THAT(toward.message, HasSubstr("direction must be 'away', not 'toward'"));
}

// Registrations on a lone edge can give any scale along it.
TEST(FitScaleLaw, RefusesScalesThatScatterWithoutALaw) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> wrong(0, 0.15);
  std::vector<ScaleSample> samples;
  for (std::size_t i = 0; i < 41; ++i) {
    const double reading_mm = 320 + 4.0 * static_cast<double>(i);
    samples.push_back({i, reading_mm, 400 / reading_mm * std::exp(wrong(random))});
  }
  const ScaleLaw law = FitScaleLaw(samples, 20, 0.07, model::BenchDirection::kAway);
  EXPECT_FALSE(law.done);
  EXPECT_THAT(law.message, HasSubstr("not found reliably"));
}

TEST(FitScaleLaw, RefusesFewerThanFive) {
  const ScaleLaw law =
      FitScaleLaw(Samples(0, BenchDirection::kAway, 4, 0, 1), 2, 0.05, BenchDirection::kAway);
  EXPECT_FALSE(law.done);
  EXPECT_THAT(law.message, HasSubstr("measured on 4 frames, 5 are needed"));
  EXPECT_TRUE(
      FitScaleLaw(Samples(0, BenchDirection::kAway, 5, 0, 1), 2, 0.05, BenchDirection::kAway).done);
}

}  // namespace
}  // namespace thicklens::calib
