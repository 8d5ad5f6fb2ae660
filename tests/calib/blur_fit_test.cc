#include "blur_fit.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

using model::BenchDirection;
using ::testing::HasSubstr;

constexpr double kFocusMm = 400, kRatio = 0.45, kFloorPx2 = 0.25, kPitchMm = 0.006;
constexpr double kPixelBoxPx2 = 1.0 / 12;
// Offset of the bench scale, and the depth of the frame that relative samples refer to.
constexpr double kOffsetMm = 30, kReferenceMm = 392;

model::ThickLens Lens() { return {12.5, 12.8, 3, 4.4643}; }

// sigma^2 by the lens' own formula for the blur radius, not by the fit's.
double TrueVariance(double depth_mm, double softness_px2) {
  const double radius_mm =
      model::BlurRadiusMm(Lens(), model::ImageDistanceMm(Lens(), kFocusMm), depth_mm);
  return kFloorPx2 + softness_px2 * std::pow(kFocusMm / depth_mm, 2) +
         std::pow(kRatio * radius_mm / kPitchMm, 2);
}

struct Bench {
  BenchDirection direction = BenchDirection::kAway;
  bool relative = false;
  double softness_px2 = 0;
  double error_px2 = 0.02;
  double noise = 0;             // times error_px2
  double reading_sigma_mm = 0;  // of the readings themselves
  int count = 31;
};

std::vector<BlurSample> Samples(const Bench& bench, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  std::vector<BlurSample> samples;
  for (int i = 0; i < bench.count; ++i) {
    const double depth_mm = 330 + 150.0 * i / (bench.count - 1);
    BlurSample s;
    s.frame = static_cast<std::size_t>(i);
    s.reading_mm = model::DirectionSign(bench.direction) * (depth_mm - kOffsetMm) +
                   bench.reading_sigma_mm * normal(random);
    s.variance_px2 = TrueVariance(depth_mm, bench.softness_px2);
    if (bench.relative) {
      s.relative_scale = kReferenceMm / depth_mm;
      s.variance_px2 += kPixelBoxPx2 - s.relative_scale * s.relative_scale *
                                           (TrueVariance(kReferenceMm, 0) + kPixelBoxPx2);
    }
    s.error_px2 = bench.error_px2;
    s.variance_px2 += bench.noise * bench.error_px2 * normal(random);
    samples.push_back(s);
  }
  return samples;
}

BlurFitSetup SetupFor(const Bench& bench) {
  BlurFitSetup setup;
  setup.lens = Lens();
  setup.pixel_pitch_mm = kPitchMm;
  setup.offset_mm = {kOffsetMm, 0};
  setup.direction = bench.direction;
  setup.reading_sigma_mm = bench.reading_sigma_mm;
  setup.reference_reading_mm = model::DirectionSign(bench.direction) * (kReferenceMm - kOffsetMm);
  setup.start_focus_depth_mm = 385;
  return setup;
}

BlurFitSetup WithFloor(BlurFitSetup setup, double sigma_px2) {
  setup.floor_variance_px2 = model::Estimate{kFloorPx2, sigma_px2};
  return setup;
}

void ExpectTruth(const BlurFitResult& fit) {
  ASSERT_TRUE(fit.done) << fit.message;
  EXPECT_NEAR(fit.values[0] / kFocusMm, 1, 1e-6);
  EXPECT_NEAR(fit.values[1] / kRatio, 1, 1e-6);
  EXPECT_NEAR(fit.values[2] / kFloorPx2, 1, 1e-6);
  EXPECT_EQ(fit.values[3], kOffsetMm);
}

TEST(BlurFit, ExactAbsoluteSamplesGiveTheTruth) {
  for (const BenchDirection direction : {BenchDirection::kAway, BenchDirection::kToward}) {
    Bench bench;
    bench.direction = direction;
    const BlurFitResult fit = FitBlur(Samples(bench, 1), SetupFor(bench));
    ExpectTruth(fit);
    EXPECT_LT(fit.chi2_per_dof, 1e-8);
    for (const double weight : fit.weights) EXPECT_NEAR(weight, 1, 1e-6);
  }
}

TEST(BlurFit, ExactRelativeSamplesGiveTheTruthWithTheFloor) {
  Bench bench;
  bench.relative = true;
  const BlurFitResult fit = FitBlur(Samples(bench, 1), WithFloor(SetupFor(bench), 0));
  ExpectTruth(fit);
  // What was relative comes back absolute.
  for (std::size_t i = 0; i < fit.variances_px2.size(); ++i)
    EXPECT_NEAR(fit.variances_px2[i], TrueVariance(330 + 5.0 * static_cast<double>(i), 0), 1e-5);
}

TEST(BlurFit, ExactSamplesOfASoftTargetGiveItsSoftness) {
  Bench bench;
  bench.softness_px2 = 0.6;
  BlurFitSetup setup = WithFloor(SetupFor(bench), 0);
  setup.target_softness = true;
  const BlurFitResult fit = FitBlur(Samples(bench, 1), setup);
  ExpectTruth(fit);
  EXPECT_NEAR(fit.target_softness_px2, 0.6, 1e-5);
}

TEST(BlurFit, AWrongFloorShiftsTheFocusAsDerived) {
  // sigma_rel^2 of a texture leaves S0 (1 - s^2) to be made up by zf: dzf = zf dS0/(A uf^2),
  // dkappa/kappa = dS0/(2 A uf^2), to first order.
  Bench bench;
  bench.relative = true;
  BlurFitSetup setup = WithFloor(SetupFor(bench), 0);
  const double step_px2 = 0.02;
  setup.floor_variance_px2->value += step_px2;
  const BlurFitResult fit = FitBlur(Samples(bench, 1), setup);
  ASSERT_TRUE(fit.done);
  const double k_mm = 12.5 * kFocusMm / (kFocusMm - 12.5);
  const double curvature = std::pow(kRatio * 4.4643 * k_mm / kPitchMm / kFocusMm, 2);
  EXPECT_NEAR(std::abs(fit.values[0] - kFocusMm), kFocusMm * step_px2 / curvature,
              0.05 * kFocusMm * step_px2 / curvature);
  EXPECT_NEAR(std::abs(fit.values[1] / kRatio - 1), step_px2 / (2 * curvature),
              0.1 * step_px2 / (2 * curvature));
  EXPECT_EQ(fit.values[2], kFloorPx2 + step_px2);
}

TEST(BlurFit, AHeldFloorStaysAndHasNoRow) {
  const Bench bench;
  BlurFitSetup setup = WithFloor(SetupFor(bench), 0);
  setup.floor_variance_px2->value = 0.31;
  const BlurFitResult fit = FitBlur(Samples(bench, 1), setup);
  ASSERT_TRUE(fit.done);
  EXPECT_EQ(fit.values[2], 0.31);
  EXPECT_EQ(fit.covariance.row(2).norm(), 0);
  EXPECT_EQ(fit.covariance.col(2).norm(), 0);
  EXPECT_GT(fit.covariance(0, 0), 0);
}

// Scatter over seeded runs against the sigmas stated, for (zf, kappa, S0).
struct Spread {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero(), scatter, stated = Eigen::Vector3d::Zero();
  double correlation = 0, stated_correlation = 0;  // of zf and kappa
};
Spread Scatter(const Bench& bench, const BlurFitSetup& setup, int runs) {
  Spread spread;
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  const Eigen::Vector3d truth(kFocusMm, kRatio, kFloorPx2);
  std::mt19937 random(77);
  std::normal_distribution<double> normal(0, 1);
  for (int run = 0; run < runs; ++run) {
    BlurFitSetup drawn = setup;
    // A prior is a measurement too: it scatters with its sigma.
    if (drawn.floor_variance_px2)
      drawn.floor_variance_px2->value += drawn.floor_variance_px2->sigma * normal(random);
    const BlurFitResult fit = FitBlur(Samples(bench, 1000U + static_cast<unsigned>(run)), drawn);
    EXPECT_TRUE(fit.done) << fit.message;
    const Eigen::Vector3d error = fit.values.head<3>() - truth;
    spread.mean += error / runs;
    squares += error * error.transpose() / runs;
    spread.stated += fit.covariance.diagonal().head<3>() / runs;
    spread.stated_correlation +=
        fit.covariance(0, 1) / std::sqrt(fit.covariance(0, 0) * fit.covariance(1, 1)) / runs;
  }
  const Eigen::Matrix3d covariance = squares - spread.mean * spread.mean.transpose();
  spread.scatter = covariance.diagonal().cwiseSqrt();
  spread.stated = spread.stated.cwiseSqrt();
  spread.correlation = covariance(0, 1) / (spread.scatter[0] * spread.scatter[1]);
  return spread;
}

constexpr int kRuns = 400;

void ExpectCovers(const Spread& spread, int parameters) {
  for (int i = 0; i < parameters; ++i) {
    // The robust loss costs some information, which the covariance overstates a little.
    EXPECT_GT(spread.stated[i] / spread.scatter[i], 0.85) << "parameter " << i;
    EXPECT_LT(spread.stated[i] / spread.scatter[i], 1.2) << "parameter " << i;
    EXPECT_LT(std::abs(spread.mean[i]), 4 * spread.scatter[i] / std::sqrt(kRuns))
        << "parameter " << i;
  }
  EXPECT_NEAR(spread.stated_correlation, spread.correlation, 0.15);
}

TEST(BlurFit, CovarianceIsTheScatterOfAbsoluteFits) {
  Bench bench;
  bench.noise = 1;
  ExpectCovers(Scatter(bench, SetupFor(bench), kRuns), 3);
}

TEST(BlurFit, CovarianceIsTheScatterOfRelativeFitsWithAFloorOfKnownError) {
  Bench bench;
  bench.noise = 1;
  bench.relative = true;
  ExpectCovers(Scatter(bench, WithFloor(SetupFor(bench), 0.03), kRuns), 3);
}

TEST(BlurFit, CovarianceIncludesTheReadingsErrors) {
  Bench bench;
  bench.noise = 1;
  bench.error_px2 = 0.005;
  bench.reading_sigma_mm = 0.5;
  const Spread with = Scatter(bench, SetupFor(bench), kRuns);
  ExpectCovers(with, 3);
  // They are the larger part here.
  bench.reading_sigma_mm = 0;
  EXPECT_GT(with.stated[0], 1.5 * Scatter(bench, SetupFor(bench), 20).stated[0]);
}

TEST(BlurFit, CovarianceGrowsWhereTheScatterIsLargerThanStated) {
  Bench bench;
  bench.noise = 2;  // errors twice as large as they are said to be
  const Spread spread = Scatter(bench, SetupFor(bench), kRuns);
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(spread.stated[i] / spread.scatter[i], 1, 0.25) << "parameter " << i;
}

TEST(BlurFit, TheOffsetsErrorIsCarriedIntoTheResults) {
  Bench bench;
  bench.error_px2 = 1e-4;
  BlurFitSetup setup = SetupFor(bench);
  const double offset_sigma_mm = 1.5;
  setup.offset_mm.sigma = offset_sigma_mm;
  const auto samples = Samples(bench, 1);
  const BlurFitResult fit = FitBlur(samples, setup);
  ASSERT_TRUE(fit.done);
  EXPECT_NEAR(std::sqrt(fit.covariance(3, 3)), offset_sigma_mm, 1e-9);
  // Monte Carlo: bench zeros drawn from their distribution and taken as exact.
  std::mt19937 random(5);
  std::normal_distribution<double> drawn(kOffsetMm, offset_sigma_mm);
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  for (int run = 0; run < kRuns; ++run) {
    setup.offset_mm = {drawn(random), 0};
    const BlurFitResult one = FitBlur(samples, setup);
    ASSERT_TRUE(one.done);
    const Eigen::Vector2d error(one.values[0] - kFocusMm, one.values[1] - kRatio);
    mean += error / kRuns;
    squares += error * error.transpose() / kRuns;
  }
  const Eigen::Matrix2d scatter = squares - mean * mean.transpose();
  EXPECT_NEAR(std::sqrt(fit.covariance(0, 0) / scatter(0, 0)), 1, 0.15);
  EXPECT_NEAR(std::sqrt(fit.covariance(1, 1) / scatter(1, 1)), 1, 0.15);
  // A zero error goes about one to one into the plane of focus.
  EXPECT_NEAR(std::sqrt(fit.covariance(0, 0)), offset_sigma_mm, 0.2 * offset_sigma_mm);
}

TEST(BlurFit, OutliersAreWeightedDown) {
  Bench bench;
  bench.noise = 1;
  auto samples = Samples(bench, 3);
  const BlurFitResult clean = FitBlur(samples, SetupFor(bench));
  samples[4].variance_px2 += 3;
  samples[20].variance_px2 -= 2;
  samples[26].variance_px2 *= 3;
  const BlurFitResult fit = FitBlur(samples, SetupFor(bench));
  ASSERT_TRUE(fit.done);
  for (const std::size_t i : {4U, 20U, 26U}) EXPECT_LT(fit.weights[i], 0.01) << i;
  EXPECT_NEAR(fit.values[0], clean.values[0], std::sqrt(clean.covariance(0, 0)));
  EXPECT_NEAR(fit.values[1], clean.values[1], std::sqrt(clean.covariance(1, 1)));
}

TEST(BlurFit, TheFloorOfATextureIsNamedAsUndetermined) {
  Bench bench;
  bench.relative = true;
  const BlurFitResult fit = FitBlur(Samples(bench, 1), SetupFor(bench));
  EXPECT_FALSE(fit.done);
  EXPECT_THAT(fit.message, HasSubstr("the data do not tell apart"));
  EXPECT_THAT(fit.weak_direction, HasSubstr("blur_floor_px"));
}

TEST(BlurFit, FloorAndSoftnessTogetherAreNamedAsUndetermined) {
  Bench bench;
  bench.softness_px2 = 0.4;
  BlurFitSetup setup = SetupFor(bench);
  setup.target_softness = true;
  const BlurFitResult fit = FitBlur(Samples(bench, 1), setup);
  EXPECT_FALSE(fit.done);
  EXPECT_THAT(fit.weak_direction, HasSubstr("blur_floor_px"));
  EXPECT_THAT(fit.weak_direction, HasSubstr("target softness"));
}

TEST(BlurFit, TwoDepthsDoNotFixThreeParameters) {
  const Bench bench;
  std::vector<BlurSample> samples;
  for (int i = 0; i < 12; ++i) {
    BlurSample s;
    const double depth_mm = i % 2 == 0 ? 350 : 450;
    s.reading_mm = depth_mm - kOffsetMm;
    s.variance_px2 = TrueVariance(depth_mm, 0);
    s.error_px2 = 0.02;
    samples.push_back(s);
  }
  const BlurFitResult fit = FitBlur(samples, SetupFor(bench));
  EXPECT_FALSE(fit.done);
  EXPECT_NE(fit.weak_direction, "") << fit.message;
  EXPECT_THAT(fit.message, HasSubstr("tell apart"));
}

TEST(BlurFit, FewerThanFourSamplesAreRefused) {
  Bench bench;
  bench.count = 3;
  const BlurFitResult fit = FitBlur(Samples(bench, 1), SetupFor(bench));
  EXPECT_FALSE(fit.done);
  EXPECT_THAT(fit.message, HasSubstr("3 frames, at least 4"));
}

}  // namespace
}  // namespace thicklens::calib
