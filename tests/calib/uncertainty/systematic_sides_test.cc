// Results of each side of focus alone, and the effect of their disagreement.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "calib/uncertainty/systematic_parts.h"
#include "tests/calib/focus_case.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using thicklens::testing::BlurBench;
using thicklens::testing::ExactBench;
using thicklens::testing::FocusCase;
using thicklens::testing::LinearReference;

constexpr double kErrorPx2 = 0.01;

// ---- the sides of focus ----

// The standard deviations of (zf, kappa) of one side with fixed floor and softness.
Eigen::Vector2d SideSigmas(const BlurBench& bench, bool nearer) {
  LinearReference reference{kErrorPx2, false, 0, true};
  for (std::size_t i = 0; i < static_cast<std::size_t>(bench.count); ++i) {
    if ((bench.Depth(i) < bench.focus_mm) == nearer) reference.frames.push_back(i);
  }
  const Eigen::Matrix4d covariance = reference.Covariance(bench);
  const double slope = std::abs(model::ImageDistanceSlope(bench.lens, bench.focus_mm));
  return {std::sqrt(covariance(0, 0)) / slope, std::sqrt(covariance(1, 1))};
}

// No frame is in the plane of focus.
BlurBench Asymmetric() {
  BlurBench bench = ExactBench();
  bench.first_mm = 342;
  bench.last_mm = 490;
  return bench;
}

// If the floor of a knife edge were free, it would absorb the difference between the sides, and the
// error of each side's focus would be several times larger.
TEST(FitSides, AKnifeEdgesFloorIsHeldAtTheWholeSweeps) {
  FocusCase c = FocusCase(Asymmetric()).WithKnifeEdge(kErrorPx2);
  c.Solve();
  for (const bool nearer : {true, false}) {
    SCOPED_TRACE(nearer);
    const SideFit& side =
        nearer ? c.calibration.diagnostics.nearer : c.calibration.diagnostics.farther;
    ASSERT_TRUE(side.done) << side.message;
    const Eigen::Vector2d sigmas = SideSigmas(c.bench, nearer);
    EXPECT_NEAR(side.focus_depth_mm.sigma, sigmas[0], 0.01 * sigmas[0]);
    EXPECT_NEAR(side.blur_ratio.sigma, sigmas[1], 0.01 * sigmas[1]);
  }
}

// The unknown constant of a texture is fixed for the same reason.
TEST(FitSides, ATexturesConstantIsHeldAtTheWholeSweeps) {
  FocusCase c = FocusCase(Asymmetric()).WithTexture(kErrorPx2).WithTrueFloor();
  // The errors are independent, so that those of the reference are the same.
  c.evidence.setup.estimators[0].covariance =
      Eigen::VectorXd::Constant(c.bench.count, kErrorPx2 * kErrorPx2).asDiagonal();
  c.Solve();
  for (const bool nearer : {true, false}) {
    SCOPED_TRACE(nearer);
    const SideFit& side =
        nearer ? c.calibration.diagnostics.nearer : c.calibration.diagnostics.farther;
    ASSERT_TRUE(side.done) << side.message;
    EXPECT_NEAR(side.focus_depth_mm.sigma, SideSigmas(c.bench, nearer)[0],
                0.01 * SideSigmas(c.bench, nearer)[0]);
  }
}

// 12 of 31 frames are nearer than 400 mm, whichever way the scale runs.
TEST(FitSides, NearerIsNearer) {
  for (const auto direction : {model::BenchDirection::kAway, model::BenchDirection::kToward}) {
    BlurBench bench = Asymmetric();
    bench.direction = direction;
    FocusCase c = FocusCase(bench).WithTexture(kErrorPx2).WithTrueFloor();
    c.Solve();
    EXPECT_EQ(c.calibration.diagnostics.nearer.frames_used, 12);
    EXPECT_EQ(c.calibration.diagnostics.farther.frames_used, 19);
  }
}

// An error of the bench offset moves both sides equally.
TEST(FitSides, TheBenchZerosErrorIsNoDifferenceOfTheSides) {
  Calibration found[2];
  for (const bool is_known : {false, true}) {
    FocusCase c =
        FocusCase(Asymmetric(), is_known ? 0 : 2.0).WithTexture(kErrorPx2).WithTrueFloor();
    c.Solve();
    found[is_known ? 1 : 0] = c.calibration;
  }
  EXPECT_GT(found[0].summary.focus_depth_mm->sigma, 10 * found[1].summary.focus_depth_mm->sigma);
  ASSERT_TRUE(found[0].diagnostics.nearer.done && found[0].diagnostics.farther.done);
  EXPECT_NEAR(found[0].diagnostics.nearer.focus_depth_mm.sigma,
              found[1].diagnostics.nearer.focus_depth_mm.sigma, 1e-4);
  EXPECT_NEAR(found[0].diagnostics.farther.focus_depth_mm.sigma,
              found[1].diagnostics.farther.focus_depth_mm.sigma, 1e-4);
}

// Edges that were measured on one side only are not used on the other.
TEST(FitSides, AnEstimatorThatHasOneSideAloneIsLeftOutOnTheOther) {
  FocusCase c = FocusCase(Asymmetric()).WithKnifeEdge(kErrorPx2).WithTexture(kErrorPx2);
  BlurSamples& edges = c.evidence.setup.estimators[0];
  edges.frames.resize(12);
  edges.variances_px2.conservativeResize(12);
  edges.covariance.conservativeResize(12, 12);
  c.Solve();
  ASSERT_TRUE(c.calibration.diagnostics.nearer.done && c.calibration.diagnostics.farther.done)
      << c.calibration.diagnostics.nearer.message << c.calibration.diagnostics.farther.message;
  EXPECT_EQ(c.calibration.diagnostics.nearer.frames_used, 12);
  EXPECT_EQ(c.calibration.diagnostics.farther.frames_used, 19);
  EXPECT_NEAR(c.calibration.diagnostics.farther.focus_depth_mm.value, c.bench.focus_mm, 0.01);
}

// Frames are counted once, for the blur estimator that has most of them.
TEST(FitSides, TheLargerEstimatorCountsTheFrames) {
  FocusCase c = FocusCase(Asymmetric()).WithTexture(kErrorPx2).WithKnifeEdge(kErrorPx2);
  BlurSamples& edges = c.evidence.setup.estimators[1];
  edges.frames.resize(20);
  edges.variances_px2.conservativeResize(20);
  edges.covariance.conservativeResize(20, 20);
  c.Solve();
  EXPECT_EQ(c.calibration.diagnostics.nearer.frames_used, 12);
  EXPECT_EQ(c.calibration.diagnostics.farther.frames_used, 19);
}

// ---- two sides that disagree ----

// A solved texture whose sides are then set to differ by so many of their standard deviations.
FocusCase Apart(double sigmas) {
  FocusCase c = FocusCase(Asymmetric()).WithTexture(kErrorPx2).WithTrueFloor();
  c.Solve();
  c.calibration.diagnostics.systematic_parts.clear();
  const double zf = c.calibration.summary.focus_depth_mm->value;
  c.calibration.diagnostics.nearer.focus_depth_mm = {zf + 0.6 * 0.5 * sigmas, 0.3};
  c.calibration.diagnostics.farther.focus_depth_mm = {zf - 0.4 * 0.5 * sigmas, 0.4};
  c.calibration.diagnostics.nearer.blur_ratio = {0.46, 0.001};
  c.calibration.diagnostics.farther.blur_ratio = {0.43, 0.001};
  AddSystematicParts(c.sweep, c.evidence, c.fit, std::nullopt, &c.calibration);
  return c;
}

TEST(AddSystematicParts, SidesWithinThreeOfTheirErrorsAgree) {
  for (const double sigmas : {2.9, -2.9}) {
    const FocusCase c = Apart(sigmas);
    EXPECT_EQ(c.Part("side of focus"), nullptr);
    EXPECT_THAT(c.calibration.summary.warnings, IsEmpty());
  }
}

TEST(AddSystematicParts, SidesFartherApartAreAPartAsLargeAsTheirAnswers) {
  for (const double sigmas : {3.1, -3.1}) {
    SCOPED_TRACE(sigmas);
    const FocusCase c = Apart(sigmas);
    const SystematicPart* part = c.Part("side of focus");
    ASSERT_NE(part, nullptr);
    const double nearer_mm = 0.3 * sigmas, farther_mm = -0.2 * sigmas;
    EXPECT_NEAR(part->focus_depth_mm.x(), std::min(nearer_mm, farther_mm), 1e-9);
    EXPECT_NEAR(part->focus_depth_mm.y(), std::max(nearer_mm, farther_mm), 1e-9);
    const double zf = c.calibration.summary.focus_depth_mm->value;
    const auto d1_mm = [&](double move_mm) {
      return model::ImageDistanceMm(c.bench.lens, zf + move_mm) -
             model::ImageDistanceMm(c.bench.lens, zf);
    };
    EXPECT_NEAR(part->image_distance_mm.x(), d1_mm(std::max(nearer_mm, farther_mm)), 1e-9);
    EXPECT_NEAR(part->image_distance_mm.y(), d1_mm(std::min(nearer_mm, farther_mm)), 1e-9);
    const double kappa = c.calibration.summary.blur_ratio->value;
    EXPECT_NEAR(part->blur_ratio.x(), 0.43 - kappa, 1e-9);
    EXPECT_NEAR(part->blur_ratio.y(), 0.46 - kappa, 1e-9);
    EXPECT_THAT(c.calibration.summary.warnings,
                Contains(AllOf(HasSubstr("two sides of focus disagree"),
                               HasSubstr("+- 0.3 mm, the farther ones"), HasSubstr("+- 0.4 mm"))));
  }
}

TEST(AddSystematicParts, SidesThatCannotBeComparedAreReportedWithTheirFrames) {
  BlurBench bench = ExactBench();
  bench.first_mm = 386.5;  // 5 frames nearer than 400 mm
  bench.last_mm = 386.5 + 3 * 30;
  bench.reference = 4;
  FocusCase c = FocusCase(bench).WithTexture(kErrorPx2).WithTrueFloor();
  c.Solve();
  EXPECT_THAT(
      c.calibration.summary.warnings,
      Contains(AllOf(
          HasSubstr("cannot be compared"),
          HasSubstr("nearer: 5 frames are on this side, but 6 are needed; farther: 26 frames"))));
  EXPECT_EQ(c.Part("side of focus"), nullptr);
}

}  // namespace
}  // namespace thicklens::calib
