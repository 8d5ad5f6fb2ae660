// The laws that relate the image scale to the readings, tested on synthetic samples.
#include "calib/registration/image_scale.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

namespace thicklens::calib {
namespace {

using model::BenchDirection;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;

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
    ScaleSample sample;
    sample.frame = static_cast<std::size_t>(i);
    sample.reading_mm = reading_mm + reading_sigma_mm * noise(random);
    sample.scale = sample.registration.scale = 400 / depth_mm;
    samples.push_back(sample);
  }
  return samples;
}

TEST(FitScaleModel, IsExactOnExactSamplesInBothDirections) {
  for (const BenchDirection direction : {BenchDirection::kAway, BenchDirection::kToward}) {
    for (const double offset_mm : {-37.5, 0.0, 106.5}) {
      const ScaleModel law =
          FitScaleModel(Samples(offset_mm, direction, 21, 0, 1), 10, 0, direction);
      ASSERT_TRUE(law.done) << law.message;
      EXPECT_EQ(law.kind, ScaleKind::kInverseDepth);
      EXPECT_NEAR(law.offset_mm.value, offset_mm, 1e-9);
      EXPECT_NEAR(law.reference_depth_mm, 400, 1e-9);
      EXPECT_EQ(law.frames_used, 21);
      EXPECT_LT(law.reading_rms_mm, 1e-9);
    }
  }
}

TEST(FitScaleModel, SigmaCoversTheScatter) {
  constexpr int kRuns = 200;
  double sum = 0, squares = 0, stated = 0;
  for (int run = 0; run < kRuns; ++run) {
    const ScaleModel law = FitScaleModel(
        Samples(20, BenchDirection::kAway, 31, 0.07, 50U + static_cast<unsigned>(run)), 15, 0.07,
        BenchDirection::kAway);
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

TEST(FitScaleModel, AFewWrongReadingsDoNotMoveIt) {
  auto samples = Samples(20, BenchDirection::kAway, 31, 0.05, 9);
  const ScaleModel clean = FitScaleModel(samples, 15, 0.05, BenchDirection::kAway);
  samples[3].reading_mm += 10;
  samples[27].reading_mm -= 15;
  std::swap(samples[10].reading_mm, samples[14].reading_mm);
  const ScaleModel law = FitScaleModel(samples, 15, 0.05, BenchDirection::kAway);
  ASSERT_TRUE(law.done);
  EXPECT_NEAR(law.offset_mm.value, clean.offset_mm.value, clean.offset_mm.sigma);
  EXPECT_EQ(law.frames_used, 27);
}

// Adds errors to the scales and states them.
void AddScaleErrors(double sigma, unsigned seed, std::vector<ScaleSample>* samples) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0, 1);
  for (ScaleSample& s : *samples) {
    s.scale *= 1 + sigma * noise(random);
    s.registration.scale = s.scale;
    s.registration.scale_sigma = sigma * s.scale;
  }
}

TEST(FitScaleModel, ScalesAreWeightedByTheirOwnErrors) {
  // Every other scale is bad, and its stated error shows that.
  constexpr int kRuns = 60;
  double reported = 0, untold = 0;
  for (unsigned run = 0; run < kRuns; ++run) {
    auto samples = Samples(20, BenchDirection::kAway, 31, 0.02, 200 + run);
    std::mt19937 random(run);
    std::normal_distribution<double> noise(0, 1);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const double sigma = i % 2 == 0 ? 1e-5 : 1e-3;
      samples[i].scale *= 1 + sigma * noise(random);
      samples[i].registration.scale_sigma = sigma * samples[i].scale;
    }
    const ScaleModel law = FitScaleModel(samples, 15, 0.02, BenchDirection::kAway);
    ASSERT_TRUE(law.done) << law.message;
    reported += std::pow(law.offset_mm.value - 20, 2);
    for (ScaleSample& s : samples) s.registration.scale_sigma = 0;
    untold +=
        std::pow(FitScaleModel(samples, 15, 0.02, BenchDirection::kAway).offset_mm.value - 20, 2);
  }
  EXPECT_LT(reported, 0.3 * untold);
}

TEST(FitScaleModel, SigmaCoversTheErrorsOfTheScales) {
  double squares = 0;
  constexpr int kRuns = 100;
  for (unsigned run = 0; run < kRuns; ++run) {
    auto samples = Samples(20, BenchDirection::kAway, 31, 0.01, 300 + run);
    AddScaleErrors(3e-4, 400 + run, &samples);
    const ScaleModel law = FitScaleModel(samples, 15, 0.01, BenchDirection::kAway);
    ASSERT_TRUE(law.done) << law.message;
    squares += std::pow((law.offset_mm.value - 20) / law.offset_mm.sigma, 2) / kRuns;
  }
  EXPECT_GT(std::sqrt(squares), 0.5);
  EXPECT_LT(std::sqrt(squares), 1.2);
}

TEST(FitScaleModel, OneReadingMayBeWrongByAnyAmount) {
  const auto right = Samples(20, BenchDirection::kAway, 21, 0.05, 11);
  const ScaleModel clean = FitScaleModel(right, 10, 0.05, BenchDirection::kAway);
  for (const double error_mm : {-1e6, -300.0, -1.0, 3.0, 50.0, 1e4}) {
    for (const std::size_t frame : {std::size_t{0}, std::size_t{10}, std::size_t{20}}) {
      auto samples = right;
      samples[frame].reading_mm += error_mm;
      const ScaleModel law = FitScaleModel(samples, 10, 0.05, BenchDirection::kAway);
      ASSERT_TRUE(law.done) << error_mm << ": " << law.message;
      EXPECT_NEAR(law.offset_mm.value, clean.offset_mm.value, 1.5 * clean.offset_mm.sigma);
      EXPECT_EQ(law.frames_used, 20) << error_mm;
      EXPECT_LT(law.reading_rms_mm, 0.1);
    }
  }
}

TEST(FitScaleModel, AFifthOfTheFramesMayBeWrong) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    auto samples = Samples(20, BenchDirection::kAway, 30, 0.05, 30 + seed);
    const ScaleModel clean = FitScaleModel(samples, 15, 0.05, BenchDirection::kAway);
    std::mt19937 random(seed);
    std::vector<std::size_t> order(samples.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::shuffle(order.begin(), order.end(), random);
    std::uniform_real_distribution<double> wrong(5, 80);
    for (std::size_t i = 0; i < 6; ++i) samples[order[i]].reading_mm += wrong(random);
    const ScaleModel law = FitScaleModel(samples, 15, 0.05, BenchDirection::kAway);
    ASSERT_TRUE(law.done) << law.message;
    EXPECT_NEAR(law.offset_mm.value, clean.offset_mm.value, 3 * law.offset_mm.sigma);
    EXPECT_EQ(law.frames_used, 24);
  }
}

// The readings of a bench in an order that differs from that of the frames.
TEST(FitScaleModel, ReadingsInARandomOrderFollowNoModel) {
  for (const int count : {7, 15, 41, 131}) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
      auto samples = Samples(20, BenchDirection::kAway, count, 0.05, seed);
      AddScaleErrors(3e-5, seed, &samples);
      std::vector<double> readings;
      for (const ScaleSample& s : samples) readings.push_back(s.reading_mm);
      std::mt19937 random(seed);
      std::shuffle(readings.begin(), readings.end(), random);
      for (std::size_t i = 0; i < samples.size(); ++i) samples[i].reading_mm = readings[i];
      const ScaleModel law = FitScaleModel(samples, 0, 0.05, BenchDirection::kAway);
      EXPECT_FALSE(law.done);
      EXPECT_EQ(law.kind, ScaleKind::kUnknown) << count << " frames, seed " << seed;
      EXPECT_THAT(law.message, HasSubstr("does not follow the readings"));
      EXPECT_THAT(law.message, Not(HasSubstr("state")));
      EXPECT_FALSE(law.distortion_at_corner);
    }
  }
}

// Frames were taken at even steps of 1/z, and their table is sorted in reverse or not at all, so
// the readings are those of the sweep. If they are mirrored, such readings are not on a line.
TEST(FitScaleModel, ReadingsOfTheSweepBesideOtherFramesAreRecognised) {
  for (const BenchDirection direction : {BenchDirection::kAway, BenchDirection::kToward}) {
    for (unsigned seed = 1; seed <= 20; ++seed) {
      const double sign = model::DirectionSign(direction);
      std::vector<ScaleSample> samples(31);
      std::vector<double> readings;
      for (std::size_t i = 0; i < samples.size(); ++i) {
        const double depth_mm = 1 / (1 / 300.0 - static_cast<double>(i) * 5e-5);
        samples[i].frame = i;
        samples[i].scale = samples[i].registration.scale = 400 / depth_mm;
        readings.push_back(sign * (depth_mm - 100));
      }
      AddScaleErrors(3e-5, seed, &samples);
      std::mt19937 random(seed);
      std::shuffle(readings.begin(), readings.end(), random);
      for (std::size_t i = 0; i < samples.size(); ++i) samples[i].reading_mm = readings[i];
      const ScaleModel law = FitScaleModel(samples, 0, 0.05, direction);
      EXPECT_FALSE(law.done);
      EXPECT_THAT(law.message, HasSubstr("in another order all of them would"))
          << model::BenchDirectionName(direction) << ", seed " << seed;
      // Two more readings are wrong, at the ends, so that the order of the others stays.
      const auto by_reading = [](const ScaleSample& one, const ScaleSample& other) {
        return one.reading_mm < other.reading_mm;
      };
      std::min_element(samples.begin(), samples.end(), by_reading)->reading_mm -= 40;
      std::max_element(samples.begin(), samples.end(), by_reading)->reading_mm += 40;
      const ScaleModel most = FitScaleModel(samples, 0, 0.05, direction);
      EXPECT_THAT(most.message, HasSubstr("in another order 29 of them would"));
    }
  }
}

// The readings are on a line except for errors that were not stated. The advice gives about their
// size, and if that size is stated, the law holds.
TEST(FitScaleModel, CoarseReadingsGetTheAdviceToStateTheirError) {
  constexpr double kSigmaMm = 3;
  int reported = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const auto samples = Samples(20, BenchDirection::kAway, 31, kSigmaMm, seed);
    const ScaleModel law = FitScaleModel(samples, 15, 0, BenchDirection::kAway);
    const std::string before = "if the readings are only accurate to about ";
    const auto at = law.message.find(before);
    if (at == std::string::npos) continue;
    ++reported;
    EXPECT_FALSE(law.done);
    EXPECT_THAT(law.message, EndsWith("mm, state reading_sigma_mm"));
    const double reported_mm = std::stod(law.message.substr(at + before.size()));
    EXPECT_NEAR(reported_mm, kSigmaMm, 0.5 * kSigmaMm);
    EXPECT_TRUE(FitScaleModel(samples, 15, reported_mm, BenchDirection::kAway).done) << seed;
  }
  EXPECT_GT(reported, 5);
}

// If a third of the readings are far off, they are not just coarse.
TEST(FitScaleModel, ManyWrongReadingsAreNotReportedAsCoarse) {
  auto samples = Samples(20, BenchDirection::kAway, 30, 0.05, 3);
  for (std::size_t i = 0; i < samples.size(); i += 3) samples[i].reading_mm += 25 + 2.0 * double(i);
  const ScaleModel law = FitScaleModel(samples, 15, 0, BenchDirection::kAway);
  EXPECT_FALSE(law.done);
  EXPECT_THAT(law.message, EndsWith("Check that every frame has its own reading"));
}

TEST(FitScaleModel, RefusesAConstantScale) {
  for (const double sigma : {0.0, 2e-5, 1e-4}) {
    auto samples = Samples(0, BenchDirection::kAway, 21, 0, 1);
    for (ScaleSample& s : samples) s.scale = 1;
    AddScaleErrors(sigma, 2, &samples);
    samples[5].scale = 1.3;  // a registration that failed
    const ScaleModel law = FitScaleModel(samples, 10, 0.05, BenchDirection::kAway);
    EXPECT_FALSE(law.done);
    EXPECT_EQ(law.kind, ScaleKind::kConstant) << law.message;
    EXPECT_THAT(law.message, HasSubstr("does not change with the reading"));
    EXPECT_THAT(law.message, Not(HasSubstr("state offset_mm"))) << "it may have been stated";
  }
}

// Half a millimetre at 2 m changes the scale by 2.5e-4, less than the errors of 3e-4.
TEST(FitScaleModel, TooShortARangeDeterminesNothing) {
  std::vector<ScaleSample> samples;
  for (std::size_t i = 0; i < 9; ++i) {
    ScaleSample sample;
    sample.frame = i;
    sample.reading_mm = 2000 + 0.0625 * static_cast<double>(i);
    sample.scale = 2000.25 / sample.reading_mm;
    samples.push_back(sample);
  }
  AddScaleErrors(3e-4, 4, &samples);
  const ScaleModel law = FitScaleModel(samples, 4, 0.001, BenchDirection::kAway);
  EXPECT_FALSE(law.done);
  EXPECT_EQ(law.kind, ScaleKind::kUnknown);
  EXPECT_THAT(law.message, HasSubstr("too little to determine"));
  EXPECT_THAT(law.message, EndsWith("extend the sweep"));
  // Without the errors the law is found.
  for (ScaleSample& s : samples) {
    s.scale = 2000.25 / s.reading_mm;
    s.registration.scale_sigma = 1e-6;
  }
  const ScaleModel clear = FitScaleModel(samples, 4, 0.0001, BenchDirection::kAway);
  EXPECT_EQ(clear.kind, ScaleKind::kInverseDepth);
  EXPECT_GT(clear.offset_mm.sigma, 50);
}

TEST(FitScaleModel, RefusesAReversedScaleAndNamesTheDirection) {
  const ScaleModel away = FitScaleModel(Samples(700, BenchDirection::kToward, 21, 0.05, 1), 10,
                                        0.05, BenchDirection::kAway);
  EXPECT_FALSE(away.done);
  EXPECT_EQ(away.kind, ScaleKind::kReversed);
  EXPECT_THAT(away.message,
              HasSubstr("larger at larger readings, so direction must be 'toward', not"));
  const ScaleModel toward = FitScaleModel(Samples(0, BenchDirection::kAway, 21, 0.05, 1), 10, 0.05,
                                          BenchDirection::kToward);
  EXPECT_FALSE(toward.done);
  EXPECT_EQ(toward.kind, ScaleKind::kReversed);
  EXPECT_THAT(toward.message,
              HasSubstr("smaller at larger readings, so direction must be 'away', not"));
}

// Registrations on a lone edge can give any scale along it.
TEST(FitScaleModel, RefusesScalesThatScatterWithoutAModel) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> wrong(0, 0.15);
  std::vector<ScaleSample> samples;
  for (std::size_t i = 0; i < 41; ++i) {
    const double reading_mm = 320 + 4.0 * static_cast<double>(i);
    ScaleSample sample;
    sample.frame = i;
    sample.reading_mm = reading_mm;
    sample.scale = 400 / reading_mm * std::exp(wrong(random));
    samples.push_back(sample);
  }
  const ScaleModel law = FitScaleModel(samples, 20, 0.07, model::BenchDirection::kAway);
  EXPECT_FALSE(law.done);
  EXPECT_EQ(law.kind, ScaleKind::kUnknown);
  EXPECT_THAT(law.message, HasSubstr("does not follow the readings"));
}

TEST(FitScaleModel, RefusesFewerThanFive) {
  const ScaleModel law =
      FitScaleModel(Samples(0, BenchDirection::kAway, 4, 0, 1), 2, 0.05, BenchDirection::kAway);
  EXPECT_FALSE(law.done);
  EXPECT_THAT(law.message, HasSubstr("measured on 4 frames only, but 5 are needed"));
  EXPECT_TRUE(
      FitScaleModel(Samples(0, BenchDirection::kAway, 5, 0, 1), 2, 0.05, BenchDirection::kAway)
          .done);
}

TEST(FitScaleModel, RefusesFewerThanFiveDifferentReadings) {
  auto samples = Samples(0, BenchDirection::kAway, 12, 0, 1);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i].reading_mm = 100 + double(i % 4);
  const ScaleModel law = FitScaleModel(samples, 2, 0.05, BenchDirection::kAway);
  EXPECT_FALSE(law.done);
  EXPECT_THAT(law.message, HasSubstr("5 are needed at different readings"));
}

// Cubic terms from the closed form k (1 - 1/s^2), with errors and with some wrong ones.
TEST(FitScaleModel, ReportsTheDistortionOfTheCorner) {
  constexpr double kCornerPx = 360, kDistortion = -0.012;
  const double k = kDistortion / (kCornerPx * kCornerPx);
  double squares = 0;
  constexpr int kRuns = 40;
  for (unsigned run = 0; run < kRuns; ++run) {
    auto samples = Samples(20, BenchDirection::kAway, 31, 0.05, 500 + run);
    std::mt19937 random(run);
    std::normal_distribution<double> noise(0, 1);
    for (ScaleSample& s : samples) {
      s.registration.cubic_sigma = 0.05 * std::abs(k);
      s.registration.cubic = k * (1 - 1 / (s.scale * s.scale)) + 0.05 * std::abs(k) * noise(random);
    }
    samples[3].registration.cubic *= -20;
    const ScaleModel law = FitScaleModel(samples, 15, 0.05, BenchDirection::kAway, kCornerPx);
    ASSERT_TRUE(law.done && law.distortion_at_corner) << law.message;
    EXPECT_NEAR(law.distortion_at_corner->value, kDistortion, 0.25 * std::abs(kDistortion));
    squares +=
        std::pow((law.distortion_at_corner->value - kDistortion) / law.distortion_at_corner->sigma,
                 2) /
        kRuns;
    EXPECT_FALSE(FitScaleModel(samples, 15, 0.05, BenchDirection::kAway).distortion_at_corner);
  }
  EXPECT_GT(std::sqrt(squares), 0.5);
  EXPECT_LT(std::sqrt(squares), 1.3);
}

// Strong distortion is determined badly if the registrations are bad, but its existence is certain.
TEST(FitScaleModel, StrongDistortionIsReportedHoweverUncertain) {
  constexpr double kCornerPx = 360, kPerSquare = 1 / (kCornerPx * kCornerPx);
  auto samples = Samples(20, BenchDirection::kAway, 31, 0.05, 9);
  const auto at_corner = [&](double distortion) {
    std::mt19937 random(1);
    std::normal_distribution<double> noise(0, 1);
    for (ScaleSample& s : samples) {
      s.registration.cubic_sigma = 0.02 * kPerSquare;
      s.registration.cubic =
          kPerSquare * (distortion * (1 - 1 / (s.scale * s.scale)) + 0.02 * noise(random));
    }
    return FitScaleModel(samples, 15, 0.05, BenchDirection::kAway, kCornerPx).distortion_at_corner;
  };
  for (const double distortion : {-0.3, 0.3}) {
    const auto found = at_corner(distortion);
    ASSERT_TRUE(found) << distortion;
    EXPECT_GT(found->sigma, 0.01);
    EXPECT_NEAR(found->value, distortion, 3 * found->sigma);
  }
  EXPECT_FALSE(at_corner(0.04)) << "two standard deviations";
}

// The uncertainty of the distortion makes the offset uncertain as well.
TEST(FitScaleModel, UncertainDistortionWidensTheOffset) {
  auto samples = Samples(20, BenchDirection::kAway, 31, 0.05, 9);
  double narrow_mm = 0;
  for (const double corner_sigma : {1e-5, 3e-2}) {
    for (ScaleSample& s : samples) s.registration.cubic_sigma = corner_sigma / (360 * 360);
    const ScaleModel law = FitScaleModel(samples, 15, 0.05, BenchDirection::kAway, 360);
    ASSERT_TRUE(law.done);
    if (corner_sigma < 1e-3) {
      narrow_mm = law.offset_mm.sigma;
    } else {
      EXPECT_GT(law.offset_mm.sigma, 3 * narrow_mm);
      EXPECT_FALSE(law.distortion_at_corner);
    }
  }
}

}  // namespace
}  // namespace thicklens::calib
