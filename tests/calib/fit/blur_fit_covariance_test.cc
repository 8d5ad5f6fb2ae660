// The covariance that FitBlur states is compared with the scatter of its answers.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <functional>
#include <random>

#include "calib/fit/blur_fit.h"
#include "tests/calib/blur_samples.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::BlurBench;
using thicklens::testing::kReferencePx2;
using thicklens::testing::WithEdge;
using thicklens::testing::WithReadings;
using thicklens::testing::WithTexture;

using Draw = std::function<BlurFitSetup(std::mt19937*)>;

// The scatter of (zf, kappa, S0) over seeded draws is compared with the stated covariance.
void ExpectCovers(const BlurBench& bench, const Draw& draw, int parameters, int runs,
                  double within = 0.15) {
  const Eigen::Vector3d truth(bench.focus_mm, bench.ratio, bench.floor_px2);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero(), stated = Eigen::Matrix3d::Zero();
  for (int run = 0; run < runs; ++run) {
    std::mt19937 random(1000U + static_cast<unsigned>(run));
    const BlurFitResult fit = FitBlur(draw(&random));
    ASSERT_TRUE(fit.done) << fit.message << " in run " << run;
    const Eigen::Vector3d error = fit.values.head<3>() - truth;
    mean += error / runs;
    squares += error * error.transpose() / runs;
    // The widening by chance that occurs now and then is not a part of the covariance itself.
    stated += fit.covariance.topLeftCorner<3, 3>() / (fit.error_factor * fit.error_factor) / runs;
  }
  const Eigen::Matrix3d scatter = squares - mean * mean.transpose();
  for (int i = 0; i < parameters; ++i) {
    EXPECT_NEAR(std::sqrt(stated(i, i) / scatter(i, i)), 1, within) << "parameter " << i;
    EXPECT_LT(std::abs(mean[i]), 4 * std::sqrt(scatter(i, i) / runs)) << "parameter " << i;
  }
  const auto correlation = [](const Eigen::Matrix3d& c) {
    return c(0, 1) / std::sqrt(c(0, 0) * c(1, 1));
  };
  EXPECT_NEAR(correlation(stated), correlation(scatter), 0.15);
}

constexpr int kRuns = 300;

TEST(FitBlurCovariance, IsTheScatterOfAKnifeEdge) {
  for (const BlurModel law : {BlurModel::kPerspective, BlurModel::kTelecentric}) {
    BlurBench bench;
    bench.law = law;
    ExpectCovers(
        bench, [&](std::mt19937* random) { return WithEdge(bench, 0.02, random); }, 3, kRuns);
  }
}

TEST(FitBlurCovariance, IsTheScatterOfSevenFrames) {
  BlurBench bench;
  bench.count = 7;
  bench.reference = 3;
  ExpectCovers(
      bench, [&](std::mt19937* random) { return WithEdge(bench, 0.02, random); }, 3, kRuns);
  ExpectCovers(
      bench, [&](std::mt19937* random) { return WithTexture(bench, 0.02, 0, random); }, 2, kRuns);
}

TEST(FitBlurCovariance, IsTheScatterOfATextureWithAGivenFloor) {
  BlurBench bench;
  ExpectCovers(
      bench, [&](std::mt19937* random) { return WithTexture(bench, 0.02, 0.05, random); }, 3,
      kRuns);
}

TEST(FitBlurCovariance, IncludesTheReadingsErrors) {
  BlurBench bench;
  bench.reading_sigma_mm = 0.3;
  ExpectCovers(
      bench, [&](std::mt19937* random) { return WithEdge(bench, 0.01, random); }, 3, kRuns);
  // The errors of the readings are the larger part here.
  std::mt19937 random(1);
  const double with = FitBlur(WithEdge(bench, 0.01, &random)).covariance(0, 0);
  bench.reading_sigma_mm = 0;
  EXPECT_GT(with, 4 * FitBlur(WithEdge(bench, 0.01, &random)).covariance(0, 0));
}

TEST(FitBlurCovariance, IncludesTheReadingsErrorsOfSevenFrames) {
  BlurBench bench;
  bench.count = 7;
  bench.reference = 3;
  bench.reading_sigma_mm = 0.07;
  ExpectCovers(
      bench, [&](std::mt19937* random) { return WithTexture(bench, 0.02, 0, random); }, 2, kRuns);
}

TEST(FitBlurCovariance, HoldsWithScalesThatTellTheReadings) {
  for (const double scale_sigma : {3e-5, 1e-3}) {
    SCOPED_TRACE(scale_sigma);
    BlurBench bench = WithReadings(0.3, scale_sigma);
    ExpectCovers(
        bench, [&](std::mt19937* random) { return WithEdge(bench, 0.01, random); }, 3, kRuns);
  }
}

TEST(FitBlurCovariance, HoldsForTwoEstimators) {
  BlurBench bench;
  bench.reading_sigma_mm = 0.07;
  ExpectCovers(
      bench,
      [&](std::mt19937* random) {
        BlurFitSetup setup = bench.Setup(random);
        setup.estimators = {bench.Absolute(0.05, 0, random),
                            bench.Relative(0.01, kReferencePx2, random)};
        setup.estimators[0].held_softness_px2 = 0;
        return setup;
      },
      3, kRuns);
}

// Bench offsets are drawn from their distribution and used as exact. The results scatter by as much
// as the covariance states for a zero with that sigma.
TEST(FitBlurCovariance, CarriesTheBenchZerosError) {
  BlurBench bench;
  bench.noise = 0;
  std::mt19937 random(5);
  BlurFitSetup setup = WithEdge(bench, 1e-4, &random);
  const double offset_sigma_mm = 1.5;
  setup.offset_mm.sigma = offset_sigma_mm;
  const BlurFitResult fit = FitBlur(setup);
  ASSERT_TRUE(fit.done);
  EXPECT_NEAR(fit.covariance(kBenchOffset, kBenchOffset), offset_sigma_mm * offset_sigma_mm, 1e-9);
  std::normal_distribution<double> drawn(bench.offset_mm, offset_sigma_mm);
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  for (int run = 0; run < kRuns; ++run) {
    setup.offset_mm = {drawn(random), 0};
    const BlurFitResult one = FitBlur(setup);
    ASSERT_TRUE(one.done);
    const Eigen::Vector2d error = one.values.head<2>() - fit.values.head<2>();
    mean += error / kRuns;
    squares += error * error.transpose() / kRuns;
  }
  const Eigen::Matrix2d scatter = squares - mean * mean.transpose();
  for (const int i : {kFocusDepth, kBlurRatio})
    EXPECT_NEAR(std::sqrt(fit.covariance(i, i) / scatter(i, i)), 1, 0.15) << i;
  // The error of the zero enters the plane of focus one to one.
  EXPECT_NEAR(std::sqrt(fit.covariance(0, 0)), offset_sigma_mm, 0.2 * offset_sigma_mm);
  EXPECT_GT(fit.covariance(kFocusDepth, kBenchOffset), 0);
}

}  // namespace
}  // namespace thicklens::calib
