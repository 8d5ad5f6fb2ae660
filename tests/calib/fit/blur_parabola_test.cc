#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "calib/fit/blur_fit.h"
#include "tests/calib/blur_samples.h"

namespace thicklens::calib {
namespace {

using thicklens::testing::BlurBench;

struct Drawn {
  Eigen::VectorXd depths_mm, variances_px2, errors_px2;

  Parabola Fit(double reading_sigma_mm = 0) const {
    return FitParabola(depths_mm, variances_px2, errors_px2, reading_sigma_mm);
  }
};

// V(z) = a (z - v)^2 + c with its errors.
constexpr double kVertexMm = 395, kCurve = 0.004, kMinPx2 = -0.3;
double Law(double z_mm) { return kCurve * (z_mm - kVertexMm) * (z_mm - kVertexMm) + kMinPx2; }

Drawn Draw(int count, double error_px2, double noise, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  Drawn drawn;
  drawn.depths_mm = Eigen::VectorXd::LinSpaced(count, 340, 460);
  drawn.variances_px2 = drawn.depths_mm;
  drawn.errors_px2 = Eigen::VectorXd::Constant(count, error_px2);
  for (Eigen::Index i = 0; i < count; ++i)
    drawn.variances_px2[i] = Law(drawn.depths_mm[i]) + noise * error_px2 * normal(random);
  return drawn;
}

TEST(FitParabola, ExactSamplesGiveTheParabola) {
  const Parabola parabola = Draw(15, 0.01, 0, 1).Fit();
  ASSERT_TRUE(parabola.done);
  EXPECT_NEAR(parabola.vertex_mm, kVertexMm, 1e-8);
  for (const double z_mm : {300.0, 395.0, 401.0, 470.0}) {
    EXPECT_NEAR(parabola.At(z_mm), Law(z_mm), 1e-8);
    if (z_mm == kVertexMm) continue;
    const std::vector<double> depths_mm = parabola.DepthsOf(Law(z_mm), z_mm + 0.1);
    ASSERT_EQ(depths_mm.size(), 2U);
    EXPECT_NEAR(depths_mm[0], z_mm, 1e-6);
    EXPECT_NEAR(depths_mm[1], 2 * kVertexMm - z_mm, 1e-6);
  }
  EXPECT_TRUE(parabola.DepthsOf(kMinPx2 - 0.01, kVertexMm).empty());
  for (const bool follows : parabola.follows) EXPECT_TRUE(follows);
  EXPECT_LT(parabola.residuals_px2.cwiseAbs().maxCoeff(), 1e-9);
}

TEST(FitParabola, CleanNoiseIsNeverThrownOut) {
  int off = 0;
  for (unsigned seed = 0; seed < 100; ++seed) {
    const Parabola parabola = Draw(seed % 2 == 0 ? 31 : 7, 0.2, 1, seed).Fit();
    ASSERT_TRUE(parabola.done);
    off += static_cast<int>(std::count(parabola.follows.begin(), parabola.follows.end(), false));
    EXPECT_NEAR(parabola.vertex_mm, kVertexMm, 3);
  }
  EXPECT_EQ(off, 0);
}

TEST(FitParabola, AQuarterOfWrongSamplesIsNamedAndLeftOut) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    Drawn drawn = Draw(31, 0.02, 1, seed);
    std::mt19937 random(seed);
    std::vector<std::size_t> wrong = {2, 5, 9, 15, 16, 23, 29, 30};
    std::uniform_real_distribution<double> off(0.8, 6);
    for (const std::size_t i : wrong)
      drawn.variances_px2[static_cast<Eigen::Index>(i)] +=
          (random() % 2 == 0 ? 1 : -1) * off(random);
    const Parabola parabola = drawn.Fit();
    ASSERT_TRUE(parabola.done);
    for (std::size_t i = 0; i < 31; ++i) {
      const bool is_wrong = std::find(wrong.begin(), wrong.end(), i) != wrong.end();
      EXPECT_EQ(parabola.follows[i], !is_wrong) << i << " of seed " << seed;
    }
    EXPECT_NEAR(parabola.vertex_mm, kVertexMm, 0.5);
  }
}

// A reading that is wrong by dz changes V by slope dz: strongly far from focus, and not at all in
// focus.
TEST(FitParabola, ReadingsErrorsCountBySlope) {
  Drawn drawn = Draw(31, 0.01, 0, 1);
  const double reading_sigma_mm = 0.5;
  // The change is three standard deviations of the reading at the end, and forty of the blur.
  drawn.variances_px2[30] += 2 * kCurve * (460 - kVertexMm) * 1.5;
  EXPECT_TRUE(drawn.Fit(reading_sigma_mm).follows[30]);
  EXPECT_FALSE(drawn.Fit(0).follows[30]);
  const Parabola parabola = drawn.Fit(reading_sigma_mm);
  const double slope = 2 * kCurve * (340 - kVertexMm);
  const double model_error =
      0.002 * (drawn.variances_px2.maxCoeff() - drawn.variances_px2.minCoeff());
  EXPECT_NEAR(parabola.sigmas_px2[0],
              std::sqrt(1e-4 + std::pow(slope * reading_sigma_mm, 2) + model_error * model_error),
              0.03 * parabola.sigmas_px2[0]);
}

// No lens follows the law with a smaller error than 0.002 of the blur's range.
TEST(FitParabola, AllowsForTheErrorOfTheModelItself) {
  Drawn drawn = Draw(31, 1e-4, 0, 1);
  const double range = drawn.variances_px2.maxCoeff() - drawn.variances_px2.minCoeff();
  EXPECT_NEAR(drawn.Fit().sigmas_px2[9], 0.002 * range, 1e-3 * range * 0.002);
  drawn.variances_px2[9] += 0.008 * range;
  EXPECT_TRUE(drawn.Fit().follows[9]);
  drawn.variances_px2[9] += 0.012 * range;
  EXPECT_FALSE(drawn.Fit().follows[9]);
}

TEST(FitParabola, NeedsFourSamplesAndThreeDepths) {
  EXPECT_FALSE(Draw(3, 0.01, 0, 1).Fit().done);
  EXPECT_TRUE(Draw(4, 0.01, 0, 1).Fit().done);
  Drawn drawn = Draw(10, 0.01, 0, 1);
  for (Eigen::Index i = 0; i < 10; ++i) drawn.depths_mm[i] = i % 2 == 0 ? 350 : 420;
  EXPECT_FALSE(drawn.Fit().done);
}

TEST(FitParabola, GivesTheSameEveryTime) {
  const Drawn drawn = Draw(31, 0.02, 1, 4);
  EXPECT_EQ(drawn.Fit().vertex_mm, drawn.Fit().vertex_mm);
}

// The vertex and the curve do not depend on c, so a texture is as good a start of the fit as an
// edge.
TEST(FromParabola, GivesFocusAndRatioByBothModelsWhateverTheSoftness) {
  for (const BlurModel law : {BlurModel::kPerspective, BlurModel::kTelecentric}) {
    for (const double softness_px2 : {0.0, 2.0, -0.9}) {
      BlurBench bench;
      bench.noise = 0;
      bench.law = law;
      std::mt19937 random(1);
      const BlurSamples samples = bench.Absolute(0.01, softness_px2, &random);
      Eigen::VectorXd depths(bench.count);
      for (int i = 0; i < bench.count; ++i) depths[i] = bench.Depth(static_cast<std::size_t>(i));
      const Parabola parabola =
          FitParabola(depths, samples.variances_px2, Eigen::VectorXd::Constant(31, 0.01), 0);
      const auto found = FromParabola(parabola, bench.Setup(&random), bench.Depth(bench.reference),
                                      bench.floor_px2);
      ASSERT_TRUE(found);
      EXPECT_NEAR(found->focus_depth_mm, bench.focus_mm, 1e-5);
      EXPECT_NEAR(found->blur_ratio, bench.ratio, 1e-8);
    }
  }
}

TEST(FromParabola, SaysNothingWhereTheBlurHasNoMinimumAboveTheFloor) {
  BlurBench bench;
  std::mt19937 random(1);
  const BlurFitSetup setup = bench.Setup(&random);
  Drawn drawn = Draw(15, 0.01, 0, 1);
  const double a = kCurve * 400 * 400;  // for z^2, times the reference's depth squared
  EXPECT_TRUE(FromParabola(drawn.Fit(), setup, 400, 0.99 * a));
  EXPECT_FALSE(FromParabola(drawn.Fit(), setup, 400, 1.01 * a));
  drawn.variances_px2 *= -1;
  EXPECT_FALSE(FromParabola(drawn.Fit(), setup, 400, 0.25));
  EXPECT_FALSE(FromParabola({}, setup, 400, 0.25));
  BlurFitSetup telecentric = setup;
  telecentric.law = BlurModel::kTelecentric;
  EXPECT_FALSE(FromParabola(drawn.Fit(), telecentric, 400, 0.25));
}

}  // namespace
}  // namespace thicklens::calib
