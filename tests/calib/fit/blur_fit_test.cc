#include "calib/fit/blur_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <vector>

#include "tests/calib/blur_samples.h"

namespace thicklens::calib {
namespace {

using model::BenchDirection;
using thicklens::testing::BlurBench;
using thicklens::testing::ExactBench;
using thicklens::testing::kReferencePx2;
using thicklens::testing::WithEdge;
using thicklens::testing::WithReadings;
using thicklens::testing::WithTexture;

void ExpectTruth(const BlurFitResult& fit, const BlurBench& bench) {
  ASSERT_TRUE(fit.done) << fit.message;
  EXPECT_NEAR(fit.values[kFocusDepth] / bench.focus_mm, 1, 1e-6);
  EXPECT_NEAR(fit.values[kBlurRatio] / bench.ratio, 1, 1e-6);
  EXPECT_NEAR(fit.values[kFloorVariance], bench.floor_px2, 1e-6);
  EXPECT_EQ(fit.values[kBenchOffset], bench.offset_mm);
  EXPECT_LT(fit.chi2_per_dof, 1e-6);
}

TEST(DefocusVariance, IsTheLensOwnBlurRadius) {
  BlurBench bench;
  std::mt19937 random(1);
  const BlurFitSetup setup = bench.Setup(&random);
  for (const double depth_mm : {320.0, 399.0, 400.0, 470.0}) {
    EXPECT_NEAR(bench.ratio * bench.ratio * DefocusVariance(setup, bench.focus_mm, depth_mm),
                bench.Variance(depth_mm) - bench.floor_px2, 1e-9);
  }
}

TEST(FitBlur, ExactAbsoluteSamplesGiveTheTruthByBothModelsInBothDirections) {
  for (const BlurModel law : {BlurModel::kPerspective, BlurModel::kTelecentric}) {
    for (const BenchDirection direction : {BenchDirection::kAway, BenchDirection::kToward}) {
      BlurBench bench = ExactBench();
      bench.law = law;
      bench.direction = direction;
      std::mt19937 random(1);
      const BlurFitResult fit = FitBlur(WithEdge(bench, 0.02, &random));
      ExpectTruth(fit, bench);
      for (const double weight : fit.weights) EXPECT_EQ(weight, 1);
      EXPECT_EQ(fit.softness_px2, std::vector<double>{0});
    }
  }
}

TEST(FitBlur, ExactRelativeSamplesGiveTheTruthAndTheirNuisance) {
  for (const BlurModel law : {BlurModel::kPerspective, BlurModel::kTelecentric}) {
    BlurBench bench = ExactBench();
    bench.law = law;
    std::mt19937 random(1);
    const BlurFitResult fit = FitBlur(WithTexture(bench, 0.02, 0, &random));
    ExpectTruth(fit, bench);
    EXPECT_NEAR(fit.softness_px2.at(0),
                kReferencePx2 - bench.OnTarget(bench.Depth(bench.reference)), 1e-5);
  }
}

TEST(FitBlur, AStartSavesTheSearchAndChangesNothing) {
  BlurBench bench;
  std::mt19937 random(5);
  const BlurFitSetup setup = WithEdge(bench, 0.02, &random);
  const BlurFitResult fit = FitBlur(setup);
  BlurFitResult far_off = fit;
  far_off.values = {415, 0.3, 0.6, bench.offset_mm};
  const BlurFitResult again = FitBlur(setup, &far_off);
  ASSERT_TRUE(fit.done && again.done);
  EXPECT_NEAR(again.values[kFocusDepth], fit.values[kFocusDepth], 1e-5);
  EXPECT_NEAR(again.values[kBlurRatio], fit.values[kBlurRatio], 1e-8);
}

// V = S0 z^2/zr^2 + A (1 - z/zf)^2/zr^2 + c for every c, so a texture determines only a = A uf^2 +
// S0 and the vertex zf (a - S0)/a. A floor that is wrong by dS0 gives zf = vertex a/(a - S0 - dS0)
// and kappa^2 in proportion to (a - S0 - dS0) (zf - f1)^2. To first order dzf = zf dS0/(A uf^2).
TEST(FitBlur, AWrongFloorMovesFocusAndRatioAsDerived) {
  const BlurBench bench = ExactBench();
  const double curvature = bench.Curvature(), a = curvature + bench.floor_px2;
  for (const double off_px2 : {-0.2, 0.15, 3.0}) {
    std::mt19937 random(1);
    BlurFitSetup setup = WithTexture(bench, 0.02, 0, &random);
    setup.floor_variance_px2->value += off_px2;
    const BlurFitResult fit = FitBlur(setup);
    ASSERT_TRUE(fit.done) << fit.message;
    const double rest = a - bench.floor_px2 - off_px2;
    const double focus_mm = bench.focus_mm * curvature / rest;
    EXPECT_NEAR(fit.values[kFocusDepth], focus_mm, 1e-3);
    EXPECT_NEAR(fit.values[kFocusDepth] - bench.focus_mm, bench.focus_mm * off_px2 / curvature,
                0.04 * std::abs(bench.focus_mm * off_px2 / curvature));
    const double f1 = bench.lens.front_focal_length_mm;
    EXPECT_NEAR(fit.values[kBlurRatio],
                bench.ratio * std::sqrt(rest / curvature) * (focus_mm - f1) / (bench.focus_mm - f1),
                1e-5);
  }
}

TEST(FitBlur, OfATelecentricLensAWrongFloorIsANuisanceAlone) {
  BlurBench bench = ExactBench();
  bench.law = BlurModel::kTelecentric;
  std::mt19937 random(1);
  BlurFitSetup setup = WithTexture(bench, 0.02, 0, &random);
  setup.floor_variance_px2->value += 1;
  const BlurFitResult fit = FitBlur(setup);
  ASSERT_TRUE(fit.done);
  EXPECT_NEAR(fit.values[kFocusDepth], bench.focus_mm, 1e-3);
  EXPECT_NEAR(fit.values[kBlurRatio], bench.ratio, 1e-6);
}

TEST(FitBlur, AHeldFloorStaysAndHasNoRow) {
  const BlurBench bench = ExactBench();
  std::mt19937 random(1);
  BlurFitSetup setup = WithEdge(bench, 0.02, &random);
  setup.floor_variance_px2 = model::Estimate{0.31, 0};
  const BlurFitResult fit = FitBlur(setup);
  ASSERT_TRUE(fit.done);
  EXPECT_EQ(fit.values[kFloorVariance], 0.31);
  for (const int held : {kFloorVariance, kBenchOffset}) {
    EXPECT_EQ(fit.covariance.row(held).norm(), 0);
    EXPECT_EQ(fit.covariance.col(held).norm(), 0);
  }
  EXPECT_GT(fit.covariance(kFocusDepth, kFocusDepth), 0);
}

TEST(FitBlur, AGivenFloorsErrorGoesIntoFocusAndRatio) {
  const BlurBench bench = ExactBench();
  std::mt19937 random(1);
  const double sigma_px2 = 0.5;
  const BlurFitResult fit = FitBlur(WithTexture(bench, 1e-3, sigma_px2, &random));
  ASSERT_TRUE(fit.done);
  // A texture contains no information about the floor.
  EXPECT_NEAR(std::sqrt(fit.covariance(kFloorVariance, kFloorVariance)), sigma_px2,
              1e-3 * sigma_px2);
  const double per_px2 = bench.focus_mm / bench.Curvature();
  EXPECT_NEAR(std::sqrt(fit.covariance(kFocusDepth, kFocusDepth)), per_px2 * sigma_px2,
              0.01 * per_px2 * sigma_px2);
  EXPECT_NEAR(fit.covariance(kFocusDepth, kFloorVariance), per_px2 * sigma_px2 * sigma_px2,
              0.01 * per_px2 * sigma_px2 * sigma_px2);
  // If the data determine the floor better, their own error counts.
  BlurFitSetup edge = WithEdge(bench, 0.02, &random);
  const double alone = FitBlur(edge).covariance(kFloorVariance, kFloorVariance);
  edge.floor_variance_px2 = model::Estimate{bench.floor_px2, 2 * std::sqrt(alone)};
  EXPECT_NEAR(FitBlur(edge).covariance(kFloorVariance, kFloorVariance), alone / (1 + 0.25),
              1e-3 * alone);
}

// A knife edge in a texture: the edge determines the floor, and the texture adds precision.
TEST(FitBlur, EdgesAndTextureTogetherAreBetterThanEither) {
  const BlurBench bench = ExactBench();
  std::mt19937 random(1);
  BlurFitSetup both = bench.Setup(&random);
  BlurSamples edge = bench.Absolute(0.2, 0, &random);
  edge.held_softness_px2 = 0;
  const BlurSamples texture = bench.Relative(0.004, kReferencePx2, &random);
  both.estimators = {edge, texture};
  const BlurFitResult fit = FitBlur(both);
  ExpectTruth(fit, bench);
  EXPECT_EQ(fit.softness_px2.at(0), 0);
  EXPECT_NEAR(fit.softness_px2.at(1), kReferencePx2 - bench.OnTarget(bench.Depth(bench.reference)),
              1e-4);
  BlurFitSetup edge_alone = both, texture_alone = both;
  edge_alone.estimators = {edge};
  texture_alone.estimators = {texture};
  const BlurFitResult by_edge = FitBlur(edge_alone);
  ASSERT_TRUE(by_edge.done);
  EXPECT_LT(fit.covariance(kFocusDepth, kFocusDepth),
            0.25 * by_edge.covariance(kFocusDepth, kFocusDepth));
  EXPECT_FALSE(FitBlur(texture_alone).done);
}

// ---- readings ----

TEST(FitBlur, PreciseScalesTellTheReadingsErrors) {
  for (const BenchDirection direction : {BenchDirection::kAway, BenchDirection::kToward}) {
    BlurBench bench = WithReadings(0.5, 2e-5);
    bench.direction = direction;
    double squares = 0, drawn_squares = 0, standardised = 0;
    int count = 0;
    for (unsigned seed = 0; seed < 20; ++seed) {
      std::mt19937 random(100 + seed);
      std::vector<double> errors_mm;
      BlurFitSetup setup = bench.Setup(&random, &errors_mm);
      setup.estimators = {bench.Absolute(0.05, 0, &random)};
      setup.estimators[0].held_softness_px2 = 0;
      const BlurFitResult fit = FitBlur(setup);
      ASSERT_TRUE(fit.done) << fit.message;
      for (std::size_t i = 0; i < errors_mm.size(); ++i) {
        const auto row = static_cast<Eigen::Index>(i);
        const double off = fit.reading_errors_mm[row] - errors_mm[i];
        squares += off * off;
        drawn_squares += errors_mm[i] * errors_mm[i];
        standardised += std::pow(off / fit.reading_error_sigmas_mm[row], 2);
        ++count;
      }
    }
    // A common offset and stretch of the readings is equivalent to the scale law, so that part
    // stays unknown.
    EXPECT_LT(squares, 0.15 * drawn_squares);
    EXPECT_NEAR(std::sqrt(standardised / count), 1, 0.15);
  }
}

TEST(FitBlur, AReadingFarOffIsFoundAndDoesNoHarm) {
  BlurBench bench = WithReadings(0.05, 2e-5);
  std::mt19937 random(3);
  std::vector<double> errors_mm;
  BlurFitSetup setup = bench.Setup(&random, &errors_mm);
  setup.estimators = {bench.Absolute(0.02, 0, &random)};
  setup.estimators[0].held_softness_px2 = 0;
  const BlurFitResult clean = FitBlur(setup);
  setup.frames[5].reading_mm += 2;
  const BlurFitResult fit = FitBlur(setup);
  ASSERT_TRUE(clean.done && fit.done);
  EXPECT_NEAR(fit.reading_errors_mm[5], 2 + errors_mm[5], 0.06);
  EXPECT_LT(fit.weights[5], 0.2);
  for (Eigen::Index i = 0; i < fit.weights.size(); ++i) {
    if (i != 5) {
      EXPECT_GT(fit.weights[i], 0.8) << i;
    }
  }
  EXPECT_NEAR(fit.values[kFocusDepth], clean.values[kFocusDepth],
              std::sqrt(clean.covariance(kFocusDepth, kFocusDepth)));
}

// The blur is compared at the estimated reading, not at the written one.
TEST(FitBlur, AReadingWithinItsErrorCostsNoWeight) {
  for (const BenchDirection direction : {BenchDirection::kAway, BenchDirection::kToward}) {
    BlurBench bench = ExactBench();
    bench.direction = direction;
    std::mt19937 random(1);
    BlurFitSetup setup = WithEdge(bench, 0.01, &random);
    setup.reading_sigma_mm = 0.3;
    setup.frames[3].reading_mm += 0.9;  // thirty times the blur's own error
    const BlurFitResult fit = FitBlur(setup);
    ASSERT_TRUE(fit.done);
    EXPECT_EQ(fit.weights.minCoeff(), 1);
    EXPECT_NEAR(fit.reading_errors_mm[3], 0.9, 0.3);  // zf absorbs a part
  }
}

TEST(FitBlur, ReadingsThatAreExactHaveNoErrors) {
  BlurBench bench;
  std::mt19937 random(3);
  const BlurFitResult fit = FitBlur(WithEdge(bench, 0.02, &random));
  ASSERT_TRUE(fit.done);
  EXPECT_EQ(fit.reading_errors_mm.norm(), 0);
  EXPECT_EQ(fit.reading_error_sigmas_mm.norm(), 0);
}

// ---- weights and widening ----

TEST(FitBlur, WeightIsLostBeyondFourStandardDeviationsOnly) {
  const BlurBench bench = ExactBench();
  constexpr double kErrorPx2 = 0.02;
  std::mt19937 random(1);
  BlurFitSetup setup = WithEdge(bench, kErrorPx2, &random);
  setup.estimators[0].variances_px2[8] += 3.5 * kErrorPx2;
  EXPECT_EQ(FitBlur(setup).weights.minCoeff(), 1);
  setup.estimators[0].variances_px2[20] += 16 * kErrorPx2;
  const BlurFitResult fit = FitBlur(setup);
  ASSERT_TRUE(fit.done);
  // The weight is 4/16, apart from the influence of the frame on the fit.
  EXPECT_NEAR(fit.weights[20], 0.25, 0.03);
  EXPECT_EQ(fit.weights[8], 1);
  EXPECT_NEAR(fit.residuals[20], 16, 1);
}

TEST(FitBlur, OutliersDoLittleHarm) {
  BlurBench bench;
  std::mt19937 random(3);
  BlurFitSetup setup = WithEdge(bench, 0.02, &random);
  const BlurFitResult clean = FitBlur(setup);
  setup.estimators[0].variances_px2[4] += 3;
  setup.estimators[0].variances_px2[20] -= 2;
  const BlurFitResult fit = FitBlur(setup);
  ASSERT_TRUE(clean.done && fit.done);
  for (const int i : {4, 20}) EXPECT_LT(fit.weights[i], 0.1) << i;
  for (const int i : {kFocusDepth, kBlurRatio}) {
    // Each outlier has the influence of a sample that is four standard deviations off.
    EXPECT_NEAR(fit.values[i], clean.values[i], 3 * std::sqrt(clean.covariance(i, i))) << i;
  }
}

// A sample without weight is not counted in chi^2 and its degrees of freedom.
TEST(FitBlur, LostWeightCountsInTheDegreesOfFreedom) {
  BlurBench bench;
  std::mt19937 random(3);
  BlurFitSetup setup = WithEdge(bench, 0.02, &random);
  for (const int i : {4, 9, 14, 20, 25})
    setup.estimators[0].variances_px2[i] += i % 2 == 0 ? 0.8 : -1;
  const BlurFitResult fit = FitBlur(setup);
  ASSERT_TRUE(fit.done);
  const double chi2 = (fit.weights.array() * fit.residuals.array().square()).sum();
  EXPECT_LT(fit.weights.sum(), 27);
  EXPECT_NEAR(fit.chi2_per_dof, chi2 / (fit.weights.sum() - 3), 0.05 * fit.chi2_per_dof);
}

TEST(FitBlur, ResidualsAreInTheirOwnStandardDeviations) {
  for (const double reading_sigma_mm : {0.0, 0.1}) {
    BlurBench bench;
    bench.reading_sigma_mm = reading_sigma_mm;
    double squares = 0, largest = 0;
    int count = 0;
    for (unsigned seed = 0; seed < 20; ++seed) {
      std::mt19937 random(40 + seed);
      const BlurFitResult fit = FitBlur(WithTexture(bench, 0.02, 0, &random));
      ASSERT_TRUE(fit.done);
      squares += fit.residuals.squaredNorm();
      largest = std::max(largest, fit.residuals.cwiseAbs().maxCoeff());
      count += bench.count;
    }
    EXPECT_NEAR(std::sqrt(squares / count), 1, 0.2) << reading_sigma_mm;
    EXPECT_LT(largest, 5) << reading_sigma_mm;
  }
}

// chi^2/dof of 28 degrees of freedom exceeds 1.72 once in a hundred.
TEST(FitBlur, ErrorsAreWidenedOnlyWhereChanceDoesNotExplainChiSquared) {
  BlurBench bench;
  int widened = 0;
  constexpr int kRuns = 150;
  for (unsigned seed = 0; seed < kRuns; ++seed) {
    std::mt19937 random(500 + seed);
    const BlurFitResult fit = FitBlur(WithEdge(bench, 0.02, &random));
    ASSERT_TRUE(fit.done);
    if (fit.chi2_per_dof > 1.75) {
      EXPECT_NEAR(fit.error_factor, std::sqrt(fit.chi2_per_dof), 1e-9);
      ++widened;
    }
    if (fit.chi2_per_dof < 1.70) {
      EXPECT_EQ(fit.error_factor, 1);
    }
  }
  EXPECT_LE(widened, 5);
  std::mt19937 random(7);
  bench.noise = 2.5;
  BlurFitSetup setup = WithEdge(bench, 0.02, &random);
  const BlurFitResult widened_fit = FitBlur(setup);
  ASSERT_TRUE(widened_fit.done);
  EXPECT_NEAR(widened_fit.error_factor, 2.5, 0.6);
  setup.estimators[0].covariance *= widened_fit.error_factor * widened_fit.error_factor;
  const BlurFitResult as_stated = FitBlur(setup);
  EXPECT_EQ(as_stated.error_factor, 1);
  EXPECT_NEAR(as_stated.covariance(0, 0) / widened_fit.covariance(0, 0), 1, 0.05);
}

TEST(FitBlur, WhereNobodyKnowsTheReadingsErrorTheScatterIsTaken) {
  BlurBench bench;
  bench.noise = 0.5;
  std::mt19937 random(8);
  BlurFitSetup setup = WithEdge(bench, 0.02, &random);
  const BlurFitResult known = FitBlur(setup);
  setup.reading_sigma_is_known = false;
  const BlurFitResult fit = FitBlur(setup);
  ASSERT_TRUE(known.done && fit.done);
  EXPECT_EQ(known.error_factor, 1);
  EXPECT_NEAR(fit.error_factor, std::sqrt(fit.chi2_per_dof), 1e-9);
  EXPECT_NEAR(fit.error_factor, 0.5, 0.2);
  EXPECT_NEAR(fit.covariance(0, 0), fit.error_factor * fit.error_factor * known.covariance(0, 0),
              1e-6 * known.covariance(0, 0));
}

}  // namespace
}  // namespace thicklens::calib
