// Conditions under which a solution is refused, and the stated reasons.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/calib/focus_case.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using thicklens::testing::BlurBench;
using thicklens::testing::ExactBench;
using thicklens::testing::FocusCase;

void ExpectRefused(const Calibration& c, const std::string& why) {
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason, HasSubstr(why));
  EXPECT_FALSE(c.summary.image_distance_mm);
  EXPECT_FALSE(c.summary.focus_depth_mm);
  EXPECT_FALSE(c.summary.blur_ratio);
  EXPECT_FALSE(c.summary.blur_floor_px);
  EXPECT_THAT(c.diagnostics.covariance_order, IsEmpty());
}

FocusCase Solved(const BlurBench& bench, double error_px2, double offset_sigma_mm = 0) {
  FocusCase c = FocusCase(bench, offset_sigma_mm).WithTexture(error_px2).WithTrueFloor();
  c.Solve();
  return c;
}

// Returns the error of the blur estimator that makes the sigma of the result this large. The sigma
// is proportional to that error. (The data are exact, so that the result stays the same.)
double ErrorFor(const BlurBench& bench, BlurParameter parameter, double sigma) {
  constexpr double kTrialPx2 = 1e-3;
  const FocusCase c = Solved(bench, kTrialPx2);
  return kTrialPx2 * sigma / std::sqrt(c.fit.covariance(parameter, parameter));
}

TEST(SolveFocus, WithoutAnEstimatorTheMeasurementSaysWhy) {
  FocusCase c;
  c.evidence.message = "neither edges nor texture";
  c.Solve();
  ExpectRefused(c.calibration, "neither edges nor texture");
  EXPECT_FALSE(c.calibration.diagnostics.blur.done);
}

TEST(SolveFocus, FourFramesAreTooFewAndFiveAreNot) {
  for (const int count : {4, 5}) {
    BlurBench bench = ExactBench();
    bench.first_mm = 360;
    bench.last_mm = 440;
    bench.count = count;
    bench.reference = 2;
    FocusCase c = FocusCase(bench).WithTexture(0.01).WithTrueFloor();
    c.Solve();
    if (count == 4) {
      ExpectRefused(c.calibration,
                    "the blur of only 4 frames follows one law, but 5 frames are needed");
    } else {
      EXPECT_EQ(c.calibration.summary.outcome, Outcome::kOk) << c.calibration.summary.reason;
    }
  }
}

// The estimator with more frames counts.
TEST(SolveFocus, AFewEdgesBesideEnoughTextureDoNoHarm) {
  for (const bool edges_first : {false, true}) {
    FocusCase c;
    if (!edges_first) c.WithTexture(0.01);
    c.WithKnifeEdge(0.01);
    BlurSamples& edges = c.evidence.setup.estimators[static_cast<std::size_t>(c.evidence.edges)];
    edges.frames = {12, 13, 14};
    edges.variances_px2 = Eigen::VectorXd(edges.variances_px2.segment(12, 3));
    edges.covariance = Eigen::MatrixXd(edges.covariance.block(12, 12, 3, 3));
    if (edges_first) c.WithTexture(0.01);
    c.Solve();
    EXPECT_EQ(c.calibration.summary.outcome, Outcome::kOk) << c.calibration.summary.reason;
  }
}

TEST(SolveFocus, AFloorAboveTheBlursCurvatureIsRefused) {
  FocusCase c = FocusCase().WithTexture(0.01).WithFloor(12, 0);  // A uf^2 = 116.6 px^2
  c.Solve();
  ExpectRefused(c.calibration, "no minimum in depth above the blur floor");
  EXPECT_THAT(c.calibration.diagnostics.blur.message, HasSubstr("no minimum"));
  EXPECT_FALSE(c.calibration.diagnostics.blur.done);
}

TEST(SolveFocus, AScaleThatDoesNotChangeIsPartOfTheReason) {
  FocusCase c = FocusCase().WithTexture(0.01).WithFloor(12, 0);
  c.calibration.diagnostics.scale.kind = ScaleKind::kConstant;
  c.calibration.diagnostics.scale.message = "the image scale is constant";
  c.Solve();
  ExpectRefused(c.calibration, "no minimum in depth");
  EXPECT_THAT(c.calibration.summary.reason, EndsWith("; the image scale is constant"));
}

TEST(SolveFocus, ABlurWithinItsErrorsIsRefused) {
  const BlurBench bench = ExactBench();
  const double a_third_px2 = ErrorFor(bench, kBlurRatio, bench.ratio / 3);
  ExpectRefused(Solved(bench, 1.08 * a_third_px2).calibration,
                "the blur does not change over the sweep by more than its errors");
  const FocusCase passes = Solved(bench, 0.92 * a_third_px2);
  EXPECT_EQ(passes.calibration.summary.outcome, Outcome::kOk) << passes.calibration.summary.reason;
}

// The blur determines where focus is in the sweep; unknown is where the sweep is. Its length is no
// measure of that: d1 and kappa depend on how far the target is from the focal point.
TEST(SolveFocus, ABenchZeroThatIsNotKnownIsNotBlamedOnTheBlur) {
  BlurBench bench = ExactBench();
  bench.first_mm = 380;
  bench.last_mm = 425;
  // kappa is in proportion to zf (zf - f1).
  const double f1_mm = bench.lens.front_focal_length_mm;
  const double ratio_per_mm = bench.ratio * (1 / bench.focus_mm + 1 / (bench.focus_mm - f1_mm));
  const double limit_mm = bench.ratio / 3 / ratio_per_mm;
  EXPECT_GT(limit_mm, 60) << "more than the length of the sweep";
  const FocusCase c = Solved(bench, 0.001, 1.1 * limit_mm);
  ExpectRefused(c.calibration,
                "the bench offset is not known well enough: the sweep is 45 mm long");
  EXPECT_THAT(c.calibration.summary.reason,
              AllOf(HasSubstr("State one of: target_period_mm"), HasSubstr("offset_mm")));
  ASSERT_TRUE(c.calibration.diagnostics.focus_reading_mm) << "the reading of focus is determined";
  EXPECT_NEAR(c.calibration.diagnostics.focus_reading_mm->value, 400 - bench.offset_mm, 0.2);
  EXPECT_LT(c.calibration.diagnostics.focus_reading_mm->sigma, 1);
  const FocusCase passes = Solved(bench, 0.001, 0.9 * limit_mm);
  EXPECT_EQ(passes.calibration.summary.outcome, Outcome::kOk) << passes.calibration.summary.reason;
  EXPECT_NEAR(passes.calibration.summary.focus_depth_mm->sigma, 0.9 * limit_mm, 0.1 * limit_mm);
  EXPECT_NEAR(passes.calibration.summary.blur_ratio->sigma, 0.9 * bench.ratio / 3,
              0.1 * bench.ratio / 3);
}

TEST(SolveFocus, AFocusThatTheBlurDoesNotFixIsRefused) {
  BlurBench bench = ExactBench();
  bench.first_mm = 380;
  bench.last_mm = 425;
  const double half_mm = 0.5 * (bench.last_mm - bench.first_mm);
  const FocusCase c = Solved(bench, ErrorFor(bench, kFocusDepth, 1.1 * half_mm));
  // If the blur ratio is even less certain, it is the stated reason.
  EXPECT_EQ(c.calibration.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.calibration.summary.reason,
              AnyOf(HasSubstr("the blur does not determine the in-focus object distance"),
                    HasSubstr("the blur does not change over the sweep")));
  EXPECT_FALSE(c.calibration.diagnostics.focus_reading_mm) << "it is not determined";
}

// Sweeps that end before they reach the focus at 400 mm, in steps of 3 mm.
BlurBench Beyond(bool focus_is_nearer) {
  BlurBench bench = ExactBench();
  bench.count = 21;
  bench.first_mm = focus_is_nearer ? 412.5 : 327.5;
  bench.last_mm = bench.first_mm + 60;
  bench.reference = focus_is_nearer ? 0 : 20;
  return bench;
}

TEST(SolveFocus, AFocusBeyondTheSweepThatIsKnownToAStepIsWarnedOf) {
  for (const bool nearer : {false, true}) {
    for (const auto direction : {model::BenchDirection::kAway, model::BenchDirection::kToward}) {
      BlurBench bench = Beyond(nearer);
      bench.direction = direction;
      const FocusCase c = Solved(bench, ErrorFor(bench, kFocusDepth, 0.9 * 3));
      EXPECT_EQ(c.calibration.summary.outcome, Outcome::kOk) << c.calibration.summary.reason;
      EXPECT_THAT(c.calibration.summary.warnings,
                  Contains(AllOf(HasSubstr("is extrapolated"), HasSubstr("12.50 mm"),
                                 HasSubstr(nearer ? "nearer than" : "farther than"))));
      EXPECT_NEAR(c.calibration.diagnostics.blur.outside_mm, 12.5, 1e-2);
    }
  }
}

TEST(SolveFocus, AFocusBeyondTheSweepThatIsNotKnownToAStepIsRefused) {
  for (const bool nearer : {false, true}) {
    const BlurBench bench = Beyond(nearer);
    const FocusCase c = Solved(bench, ErrorFor(bench, kFocusDepth, 1.1 * 3));
    ExpectRefused(c.calibration, "sharpness is monotone");
    EXPECT_THAT(c.calibration.summary.reason,
                AllOf(HasSubstr(nearer ? "lies nearer than" : "lies farther than"),
                      HasSubstr("extend the sweep"), HasSubstr("about 400")));
  }
}

// Inside the sweep the same error is accepted.
TEST(SolveFocus, AFocusInsideNeedNotBeKnownToAStep) {
  const BlurBench bench = ExactBench();
  const FocusCase c = Solved(bench, ErrorFor(bench, kFocusDepth, 1.5 * 5));
  EXPECT_EQ(c.calibration.summary.outcome, Outcome::kOk) << c.calibration.summary.reason;
  EXPECT_THAT(c.calibration.summary.warnings, Not(Contains(HasSubstr("extrapolated"))));
}

// A gap in the readings does not increase the step, and repeated readings do not make it 0.
TEST(SolveFocus, TheStepIsTheUsualOne) {
  const BlurBench bench = Beyond(true);
  FocusCase c = FocusCase(bench).WithTexture(ErrorFor(bench, kFocusDepth, 0.9 * 3)).WithTrueFloor();
  FrameMeasurement again = c.calibration.frames.back();
  again.rejection = "blank";
  for (int i = 0; i < 30; ++i) c.calibration.frames.push_back(again);
  again.reading_mm += 500;
  c.calibration.frames.push_back(again);
  c.Solve();
  EXPECT_EQ(c.calibration.summary.outcome, Outcome::kOk) << c.calibration.summary.reason;
}

// No lens has such a blur ratio, so the stated aperture is wrong. The sweep measures kappa r.
TEST(SolveFocus, AnImplausibleBlurRatioIsRefusedAndAnUnusualOneWarnedOf) {
  struct Case {
    double ratio;
    bool refused, warned;
  };
  const Case cases[] = {{0.19, true, false},  {0.21, false, true},  {0.34, false, true},
                        {0.36, false, false}, {0.64, false, false}, {0.66, false, true},
                        {0.79, false, true},  {0.81, true, false}};
  for (const Case& k : cases) {
    SCOPED_TRACE(k.ratio);
    FocusCase c = FocusCase().WithTexture(0.01).WithTrueFloor();
    const double factor = c.bench.ratio / k.ratio;
    c.evidence.setup.lens.aperture_radius_mm *= factor;
    c.sweep.camera.lens.aperture_radius_mm *= factor;
    c.Solve();
    if (k.refused) {
      ExpectRefused(c.calibration, "which no lens has");
      EXPECT_THAT(c.calibration.summary.reason, HasSubstr("check focal lengths"));
      continue;
    }
    EXPECT_EQ(c.calibration.summary.outcome, Outcome::kOk) << c.calibration.summary.reason;
    EXPECT_NEAR(c.calibration.summary.blur_ratio->value, k.ratio, 1e-3);
    EXPECT_EQ(!c.calibration.summary.warnings.empty(), k.warned);
    if (k.warned) {
      EXPECT_THAT(c.calibration.summary.warnings, Contains(HasSubstr("is unusual")));
    }
  }
}

}  // namespace
}  // namespace thicklens::calib
