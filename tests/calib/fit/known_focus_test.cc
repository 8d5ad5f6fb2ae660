#include "calib/fit/known_focus.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "tests/calib/focus_case.h"
#include "thicklens/model/objective.h"

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;
using thicklens::testing::BlurBench;
using thicklens::testing::ExactBench;

// A sweep of 30 mm about the focus at 400 mm, too short for its blur to show the bench offset.
BlurBench ShortBench() {
  BlurBench bench = ExactBench();
  bench.first_mm = 384;
  bench.last_mm = 414;
  return bench;
}

BlurFitSetup SetupOf(const BlurBench& bench, double error_px2, std::mt19937* random) {
  BlurFitSetup setup = bench.Setup(random);
  setup.estimators = {bench.Absolute(error_px2, 0, random)};
  setup.estimators[0].held_softness_px2 = 0;
  setup.floor_variance_px2 = model::Estimate{bench.floor_px2, 0};
  return setup;
}

model::StatedConjugate FocusAt(double focus_mm, double sigma_mm) {
  return {model::ConjugateKind::kFocusDepth, {focus_mm, sigma_mm}, "focus_depth_mm"};
}

TEST(KnownFocus, GivesTheOffsetFromAnyStart) {
  std::mt19937 random(1);
  for (const double start_mm : {30.0, 5.0, 90.0}) {
    BlurFitSetup setup = SetupOf(ShortBench(), 1e-3, &random);
    setup.offset_mm = {start_mm, 0};
    const BlurFitResult fit = FitBlurAtKnownFocus(setup, FocusAt(400, 0.5));
    ASSERT_TRUE(fit.done) << fit.message;
    EXPECT_NEAR(fit.values[kFocusDepth], 400, 1e-4);
    EXPECT_NEAR(fit.values[kBenchOffset], 30, 2e-3) << start_mm;
    EXPECT_NEAR(fit.values[kBlurRatio], 0.45, 1e-4);
    EXPECT_NEAR(std::sqrt(fit.covariance(kFocusDepth, kFocusDepth)), 0.5, 1e-6);
  }
}

// Every way to state the same plane of focus gives the same fit.
TEST(KnownFocus, MayBeStatedByAnyConjugate) {
  std::mt19937 random(1);
  const BlurBench bench = ShortBench();
  const BlurFitSetup setup = SetupOf(bench, 1e-3, &random);
  const double d1_mm = model::ImageDistanceMm(bench.lens, 400);
  const double rear_mm = d1_mm - bench.lens.lens_thickness_mm;
  const double m = -model::ChiefRayMagnification(bench.lens, d1_mm, 400);
  const std::vector<model::StatedConjugate> statements = {
      FocusAt(400, 0),
      {model::ConjugateKind::kImageDistance, {d1_mm, 0}, "image_distance_mm"},
      {model::ConjugateKind::kTubeLength,
       {rear_mm - bench.lens.rear_focal_length_mm, 0},
       "optical_tube_length_mm"},
      {model::ConjugateKind::kMagnification, {m, 0}, "magnification"}};
  for (const model::StatedConjugate& stated : statements) {
    const BlurFitResult fit = FitBlurAtKnownFocus(setup, stated);
    ASSERT_TRUE(fit.done) << fit.message;
    EXPECT_NEAR(fit.values[kBenchOffset], 30, 2e-3) << stated.name;
    EXPECT_NEAR(fit.values[kBlurRatio], 0.45, 1e-4) << stated.name;
  }
}

// The stated covariance is the scatter of many sweeps, each with its own noise and its own drawn
// statement. The errors of the statement and of the blur are about equally large, so that neither
// hides a mistake in the other.
TEST(KnownFocus, CovarianceIsTheScatter) {
  constexpr int kRuns = 400;
  constexpr double kErrorPx2 = 0.05;
  BlurBench bench = ShortBench();
  bench.noise = 1;
  std::mt19937 random(5);
  const double own_mm = [&] {
    const BlurFitResult fit = FitBlur(SetupOf(ShortBench(), kErrorPx2, &random));
    return std::sqrt(fit.covariance(kFocusDepth, kFocusDepth));
  }();
  const double stated_sigma_mm = 1.5 * own_mm;
  std::normal_distribution<double> normal(0, 1);
  Eigen::MatrixXd off(kRuns, 3);  // zf, kappa, offset
  Eigen::Matrix4d stated = Eigen::Matrix4d::Zero();
  const Eigen::Vector3i chosen(kFocusDepth, kBlurRatio, kBenchOffset);
  for (int run = 0; run < kRuns; ++run) {
    const BlurFitResult fit =
        FitBlurAtKnownFocus(SetupOf(bench, kErrorPx2, &random),
                            FocusAt(400 + stated_sigma_mm * normal(random), stated_sigma_mm));
    ASSERT_TRUE(fit.done) << fit.message;
    off.row(run) << fit.values[kFocusDepth] - 400, fit.values[kBlurRatio] - 0.45,
        fit.values[kBenchOffset] - 30;
    stated += fit.covariance / kRuns;
  }
  const Eigen::Matrix3d found = off.transpose() * off / kRuns;
  for (int a = 0; a < 3; ++a) {
    const double sigma = std::sqrt(stated(chosen[a], chosen[a]));
    EXPECT_NEAR(std::sqrt(found(a, a)), sigma, 0.12 * sigma) << a;
    for (int b = 0; b < a; ++b) {
      const double correlation =
          stated(chosen[a], chosen[b]) / (sigma * std::sqrt(stated(chosen[b], chosen[b])));
      EXPECT_NEAR(found(a, b) / std::sqrt(found(a, a) * found(b, b)), correlation, 0.12)
          << a << " " << b;
    }
  }
  // The offset follows from the reading at focus, so that its error contains that of the blur.
  EXPECT_NEAR(std::sqrt(stated(kBenchOffset, kBenchOffset)), std::hypot(own_mm, stated_sigma_mm),
              0.1 * own_mm);
}

TEST(KnownFocus, AnImpossibleStatementGivesNoFit) {
  std::mt19937 random(1);
  const BlurFitResult fit =
      FitBlurAtKnownFocus(SetupOf(ShortBench(), 1e-3, &random), FocusAt(12, 0.1));
  EXPECT_FALSE(fit.done);
  EXPECT_THAT(fit.message, HasSubstr("focus_depth_mm is 12"));
}

// Monte Carlo over the focal length: label and statement vary independently.
TEST(KnownFocus, TheToleranceOfTheFocalLengthIsInTheErrorOfTheDepth) {
  model::Camera camera;
  camera.lens = {100, 103, 5, 10};
  camera.statements["lens.front_focal_length_mm"].tolerance = 2;
  const std::vector<model::StatedConjugate> statements = {
      {model::ConjugateKind::kMagnification, {0.5, 0.004}, "magnification"},
      {model::ConjugateKind::kImageDistance, {160, 0.5}, "image_distance_mm"},
      {model::ConjugateKind::kTubeLength, {52, 0.5}, "optical_tube_length_mm"},
      {model::ConjugateKind::kFocusDepth, {300, 0.7}, "focus_depth_mm"}};
  for (const model::StatedConjugate& stated : statements) {
    std::mt19937 random(3);
    std::normal_distribution<double> normal(0, 1);
    std::uniform_real_distribution<double> even(-1, 1);
    constexpr int kDraws = 20000;
    double sum = 0, squares = 0;
    for (int i = 0; i < kDraws; ++i) {
      const double factor = 1 + 0.02 * even(random);
      const model::ThickLens lens = {100 * factor, 103 * factor, 5, 10};
      model::StatedConjugate drawn = stated;
      drawn.value.value += stated.value.sigma * normal(random);
      const double zf = model::FocusDepthOf(lens, drawn).value;
      sum += zf / kDraws;
      squares += zf * zf / kDraws;
    }
    const double scatter = std::sqrt(squares - sum * sum);
    EXPECT_NEAR(FocusDepthWithTolerance(camera, stated).sigma, scatter, 0.05 * scatter)
        << stated.name;
  }
}

TEST(KnownFocus, AFocalLengthWithoutAToleranceHasThatOfLabels) {
  model::Camera camera;
  camera.lens = {100, 100, 0, 10};
  EXPECT_DOUBLE_EQ(FocalLengthTolerance(camera), 0.01);
  camera.statements["lens.front_focal_length_mm"].tolerance = 0.2;
  EXPECT_DOUBLE_EQ(FocalLengthTolerance(camera), 0.002);
  camera.objective = model::Objective{10, 0.25, 200};
  EXPECT_DOUBLE_EQ(FocalLengthTolerance(camera), 0);
}

// 5 % of 10 either way, anywhere within: zf = f (1 + 1/m), and the variance of an even distribution
// is 1/3 of the square of its half width.
TEST(KnownFocus, TheMagnificationOfAnObjectiveHasTheToleranceOfTheStandard) {
  model::Camera camera;
  camera.objective = model::Objective{10, 0.25, 200};
  camera.lens = model::LensOfObjective(*camera.objective);
  const model::StatedConjugate stated = {
      model::ConjugateKind::kMagnification, {10, 0}, kFromObjective};
  EXPECT_DOUBLE_EQ(ToleranceOfStatement(camera, stated), 0.5);
  EXPECT_NEAR(FocusDepthWithTolerance(camera, stated).sigma, 20 * 0.5 / 100 / std::sqrt(3.0), 1e-9);
  camera.statements[kFromObjective] = {0.1, false};
  EXPECT_DOUBLE_EQ(ToleranceOfStatement(camera, stated), 0.1);
  // One that is assumed without a tolerance has that of the standard.
  camera.statements[kFromObjective] = {0, true};
  EXPECT_DOUBLE_EQ(ToleranceOfStatement(camera, stated), 0.5);
  EXPECT_EQ(ToleranceOfStatement(
                camera, {model::ConjugateKind::kMagnification, {9.8, 0.01}, "magnification"}),
            0);
}

}  // namespace
}  // namespace thicklens::calib
