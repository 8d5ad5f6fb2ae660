// The image distance from the image scale of a lens or a sensor that moves.
#include "calib/registration/moving_scale.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace thicklens::calib {
namespace {

using model::SweepMotion;

const model::ThickLens kLens = {50, 50, 0, 9};

// Scales by the lens equation with noise. `range_mm` is the half range of the readings.
std::vector<ScaleSample> Scales(double focus_depth_mm, SweepMotion moves, double range_mm,
                                double noise, std::uint32_t seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> normal;
  const double xf = 50 * focus_depth_mm / (focus_depth_mm - 50);
  std::vector<ScaleSample> samples;
  for (int i = 0; i < 25; ++i) {
    const double moved_mm = range_mm * (i - 12) / 12;
    const double z = focus_depth_mm - (moves == SweepMotion::kLens ? moved_mm : 0);
    ScaleSample sample;
    sample.frame = static_cast<std::size_t>(i);
    sample.reading_mm = 3 + moved_mm;
    sample.scale = (xf + moved_mm) / z * focus_depth_mm / xf * (1 + noise * normal(engine));
    sample.registration.scale_sigma = noise;
    samples.push_back(sample);
  }
  return samples;
}

TEST(MovingScale, OfASensorGivesItsDistanceWithTheErrorOfTheScatter) {
  constexpr int kRuns = 200;
  double sum = 0, square = 0, stated = 0;
  for (int run = 0; run < kRuns; ++run) {
    const MovingScale found =
        FitMovingScale(Scales(300, SweepMotion::kSensor, 0.6, 1e-4, 100U + unsigned(run)), kLens,
                       SweepMotion::kSensor, 1, 3, 0);
    ASSERT_TRUE(found.sensor_distance_mm);
    const double off = found.sensor_distance_mm->value - 60;
    sum += off;
    square += off * off;
    stated += found.sensor_distance_mm->sigma;
    EXPECT_NEAR(found.slope_per_mm.value, 1.0 / 60, 1e-3);
  }
  const double mean = sum / kRuns, scatter = std::sqrt(square / kRuns - mean * mean);
  EXPECT_LT(std::abs(mean), 4 * scatter / std::sqrt(kRuns));
  EXPECT_NEAR(stated / kRuns / scatter, 1, 0.25);
}

// d ln(scale)/d reading = 1/f at any magnification, so that a short sweep leaves the distance open.
TEST(MovingScale, OfALensGivesTheFocalLengthAndOnlyALongSweepTheDistance) {
  for (const double zf : {75.0, 150.0, 300.0, 2000.0}) {
    const MovingScale found = FitMovingScale(Scales(zf, SweepMotion::kLens, 0.6, 1e-4, 5), kLens,
                                             SweepMotion::kLens, 1, 3, 0);
    EXPECT_NEAR(found.slope_per_mm.value, 0.02, 4 * found.slope_per_mm.sigma + 1e-6);
    EXPECT_FALSE(found.sensor_distance_mm) << zf;
  }
  const MovingScale found = FitMovingScale(Scales(150, SweepMotion::kLens, 8, 1e-4, 5), kLens,
                                           SweepMotion::kLens, 1, 3, 0);
  ASSERT_TRUE(found.sensor_distance_mm);
  EXPECT_NEAR(found.sensor_distance_mm->value, 75, 4 * found.sensor_distance_mm->sigma);
  EXPECT_LT(found.sensor_distance_mm->sigma, 1);
}

// The length of a step, with the error of the scatter, for either direction of the counts.
TEST(StepLength, FollowsFromTheScaleAndAKnownDistance) {
  constexpr int kRuns = 100;
  constexpr double kMmPerStep = 0.0025;
  for (const SweepMotion moves : {SweepMotion::kSensor, SweepMotion::kLens}) {
    for (const double sign : {1.0, -1.0}) {
      int covered = 0;
      for (int run = 0; run < kRuns; ++run) {
        std::vector<ScaleSample> samples = Scales(300, moves, 2, 1e-4, 100U + unsigned(run));
        for (ScaleSample& sample : samples)
          sample.reading_mm = 5000 + sign * (sample.reading_mm - 3) / kMmPerStep;
        const model::Estimate length = FitStepLength(samples, kLens, moves, 5000, 60);
        covered += std::abs(length.value - sign * kMmPerStep) < 2 * length.sigma;
        EXPECT_LT(length.sigma, 0.01 * kMmPerStep);
      }
      EXPECT_GE(covered, 88);
    }
  }
}

TEST(MovingScale, NeedsFiveScales) {
  std::vector<ScaleSample> few = Scales(300, SweepMotion::kSensor, 0.6, 1e-4, 5);
  few.resize(4);
  const MovingScale found = FitMovingScale(few, kLens, SweepMotion::kSensor, 1, 3, 0);
  EXPECT_FALSE(found.sensor_distance_mm);
  EXPECT_EQ(found.slope_per_mm.sigma, 0);
}

}  // namespace
}  // namespace thicklens::calib
