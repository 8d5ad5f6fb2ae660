// Messages of a solution about single frames, both outliers and those that follow the law.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "tests/calib/focus_case.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;
using thicklens::testing::BlurBench;
using thicklens::testing::ExactBench;
using thicklens::testing::FocusCase;

constexpr double kErrorPx2 = 0.01;

FocusCase Texture(const BlurBench& bench = ExactBench()) {
  FocusCase c = FocusCase(bench).WithTexture(kErrorPx2).WithTrueFloor();
  return c;
}

// Removes one sample of the measurement.
void Remove(std::size_t frame, BlurSamples* estimator) {
  std::vector<Eigen::Index> kept;
  std::vector<std::size_t> frames;
  for (std::size_t i = 0; i < estimator->frames.size(); ++i) {
    if (estimator->frames[i] == frame) continue;
    kept.push_back(static_cast<Eigen::Index>(i));
    frames.push_back(estimator->frames[i]);
  }
  estimator->frames = frames;
  estimator->variances_px2 = Eigen::VectorXd(estimator->variances_px2(kept));
  estimator->covariance = Eigen::MatrixXd(estimator->covariance(kept, kept));
}

// ---- frames that do not follow the parabola ----

// The amount is the written minus the true reading. It is tested on both sides of focus, with the
// scale running either way.
TEST(SolveFocus, AWrongReadingIsNamedWithWhatItIsOffBy) {
  for (const auto direction : {model::BenchDirection::kAway, model::BenchDirection::kToward}) {
    for (const std::size_t frame : {3U, 26U}) {
      for (const double error_mm : {3.0, -3.0}) {
        SCOPED_TRACE(::testing::Message() << model::BenchDirectionName(direction) << ", frame "
                                          << frame << ", " << error_mm << " mm");
        BlurBench bench = ExactBench();
        bench.direction = direction;
        FocusCase c = Texture(bench);
        c.WriteReading(frame, c.frame(frame).reading_mm + error_mm);
        c.Solve();
        EXPECT_EQ(c.calibration.summary.outcome, Outcome::kOk) << c.calibration.summary.reason;
        const FrameMeasurement& off = c.frame(frame);
        EXPECT_NEAR(off.reading_error_mm, error_mm, 0.02 * std::abs(error_mm));
        EXPECT_THAT(off.rejection,
                    StartsWith(error_mm > 0 ? "reading off by " : "reading off by -"));
        EXPECT_THAT(off.rejection, HasSubstr("or frame damaged"));
        EXPECT_FALSE(off.in_blur_fit);
        EXPECT_EQ(c.calibration.diagnostics.blur.frames_used, c.bench.count - 1);
        EXPECT_NEAR(c.calibration.summary.focus_depth_mm->value, c.bench.focus_mm, 1e-3);
        for (std::size_t i = 0; i < static_cast<std::size_t>(c.bench.count); ++i)
          EXPECT_EQ(c.frame(i).rejection.empty(), i != frame) << i;
      }
    }
  }
}

// No reading within the sweep explains this blur.
TEST(SolveFocus, ADamagedFrameIsNotReportedAsAWrongReading) {
  FocusCase c = Texture();
  c.evidence.setup.estimators[0].variances_px2[13] += 60;
  c.Solve();
  EXPECT_THAT(c.frame(13).rejection, StartsWith("frame damaged: its blur deviates "));
  EXPECT_EQ(c.frame(13).reading_error_mm, 0);
  EXPECT_EQ(c.calibration.summary.outcome, Outcome::kOk);
}

TEST(SolveFocus, WhatIsRejectedIsNotInTheFit) {
  std::mt19937 random(7);
  BlurBench bench;
  FocusCase with = FocusCase(bench).WithTexture(kErrorPx2).WithTrueFloor();
  FocusCase without = with;
  with.evidence.setup.estimators[0].variances_px2[20] += 8;
  Remove(20, &without.evidence.setup.estimators[0]);
  with.Solve();
  without.Solve();
  EXPECT_NE(with.frame(20).rejection, "");
  EXPECT_TRUE(with.fit.values == without.fit.values);
  EXPECT_TRUE(with.fit.covariance == without.fit.covariance);
  EXPECT_EQ(with.evidence.setup.estimators[0].frames.size(), 30U);
  EXPECT_EQ(with.evidence.setup.estimators[0].variances_px2.size(), 30);
  EXPECT_EQ(with.evidence.setup.estimators[0].covariance.rows(), 30);
}

// A frame that is an outlier of one blur estimator is left out of the other one as well.
TEST(SolveFocus, AFrameIsRejectedForBothEstimators) {
  for (const std::size_t estimator : {0U, 1U}) {
    FocusCase c = FocusCase().WithTexture(kErrorPx2).WithKnifeEdge(kErrorPx2);
    c.evidence.setup.estimators[estimator].variances_px2[22] += 8;
    c.Solve();
    EXPECT_NE(c.frame(22).rejection, "");
    for (const BlurSamples& left : c.evidence.setup.estimators) {
      EXPECT_EQ(left.frames.size(), 30U);
      EXPECT_THAT(left.frames, Not(Contains(22U)));
    }
    // Properties of the blur estimators stay unchanged.
    EXPECT_FALSE(c.evidence.setup.estimators[0].held_softness_px2);
    EXPECT_TRUE(c.evidence.setup.estimators[1].held_softness_px2);
  }
}

TEST(SolveFocus, AFrameWhoseSpectrumScattersIsRejected) {
  FocusCase c = Texture();
  std::vector<double>& ratios = c.evidence.frame_noise_ratios;
  ratios.assign(static_cast<std::size_t>(c.bench.count), 0);  // most frames have no spectrum
  c.evidence.frame_misfits.assign(ratios.size(), 0.0003);
  for (std::size_t i = 0; i < 9; ++i) ratios[i] = 1.2;
  for (const std::size_t i : {4U, 5U, 7U}) c.evidence.frame_misfits[i] = 0.04;
  ratios[4] = 1.2 * 36;
  ratios[5] = 1.2 * 29;
  ratios[6] = 1.2 * 500;  // so little noise that a small error of the blur law stands out
  c.Solve();
  EXPECT_THAT(c.frame(4).rejection, AllOf(HasSubstr("does not show what the others show"),
                                          HasSubstr("deviates 6 times")));
  for (const std::size_t i : {5U, 6U, 7U}) EXPECT_EQ(c.frame(i).rejection, "") << i;
  EXPECT_THAT(c.evidence.setup.estimators[0].frames, Not(Contains(4U)));
  EXPECT_EQ(c.calibration.diagnostics.blur.frames_used, c.bench.count - 1);
}

TEST(SolveFocus, TheFirstReasonStands) {
  FocusCase c = Texture();
  c.evidence.frame_noise_ratios.assign(static_cast<std::size_t>(c.bench.count), 1);
  c.evidence.frame_noise_ratios[6] = 100;
  c.evidence.frame_misfits.assign(static_cast<std::size_t>(c.bench.count), 0.9);
  c.evidence.setup.estimators[0].variances_px2[6] += 8;
  c.Solve();
  EXPECT_THAT(c.frame(6).rejection, HasSubstr("does not show"));
  EXPECT_EQ(c.frame(6).reading_error_mm, 0);
}

// A focus counts as inside or outside of the sweep of the remaining frames.
TEST(SolveFocus, RejectedFramesDoNotReachTheSweepsRange) {
  BlurBench bench = ExactBench();
  bench.last_mm = 402;
  bench.reference = 28;
  FocusCase c = Texture(bench);
  c.evidence.setup.estimators[0].variances_px2[30] += 40;  // the one frame beyond 400 mm
  c.Solve();
  EXPECT_NE(c.frame(30).rejection, "");
  EXPECT_THAT(c.calibration.summary.warnings, Contains(HasSubstr("is extrapolated")));
}

// ---- frames with less weight ----

// The samples are off by many standard errors of the blur estimator, but by less than the accuracy
// of the law for any lens.
FocusCase WithLight(const std::vector<Eigen::Index>& frames) {
  FocusCase c = FocusCase().WithTexture(5e-4).WithTrueFloor();
  for (const Eigen::Index i : frames) c.evidence.setup.estimators[0].variances_px2[i] += 0.02;
  c.Solve();
  return c;
}

TEST(SolveFocus, LightFramesAreWarnedOfByName) {
  FocusCase c = WithLight({8});
  EXPECT_EQ(c.calibration.summary.outcome, Outcome::kOk);
  EXPECT_LT(c.frame(8).blur_fit_weight, 0.6);
  EXPECT_EQ(c.frame(8).rejection, "");
  EXPECT_TRUE(c.frame(8).in_blur_fit);
  EXPECT_THAT(c.calibration.summary.warnings,
              Contains(AllOf(StartsWith("1 of 31 frames"),
                             HasSubstr("have less weight: frame-8.png (reading 340 mm"))));
  EXPECT_THAT(c.calibration.summary.warnings, Contains(HasSubstr("deviate from the blur law")));
}

TEST(SolveFocus, ThreeLightFramesAreNamedAndTheOthersCounted) {
  FocusCase c = WithLight({4, 7, 10, 24, 27});
  EXPECT_THAT(c.calibration.summary.warnings,
              Contains(AllOf(StartsWith("5 of 31 frames"), HasSubstr("frame-4.png"),
                             HasSubstr("frame-7.png"), HasSubstr("frame-10.png"),
                             HasSubstr(" and 2 more"), Not(HasSubstr("frame-24.png")))));
}

// Deviations of up to four standard errors cost no weight.
TEST(SolveFocus, FramesWithinTheirErrorsHaveWeightOne) {
  FocusCase c = FocusCase().WithTexture(5e-4).WithTrueFloor();
  c.evidence.setup.estimators[0].variances_px2[8] += 0.0015;
  c.Solve();
  EXPECT_THAT(c.calibration.summary.warnings, IsEmpty());
  EXPECT_EQ(c.frame(8).blur_fit_weight, 1);
}

// ---- frames that follow ----

TEST(SolveFocus, EveryFrameGetsItsBlur) {
  for (const bool is_edge : {false, true}) {
    SCOPED_TRACE(is_edge);
    FocusCase c;
    if (is_edge) {
      c.WithKnifeEdge(kErrorPx2);
    } else {
      c.WithTexture(kErrorPx2).WithTrueFloor();
    }
    c.Solve();
    for (std::size_t i = 0; i < static_cast<std::size_t>(c.bench.count); ++i) {
      const FrameMeasurement& frame = c.frame(i);
      const double depth_mm = c.bench.Depth(i);
      const double sigma_px = std::sqrt(c.bench.Variance(depth_mm));
      EXPECT_NEAR(frame.blur_sigma_px, sigma_px, 2e-4) << i;
      EXPECT_TRUE(frame.in_blur_fit);
      EXPECT_EQ(frame.blur_fit_weight, 1);
      EXPECT_EQ(frame.not_in_fit, "");
      // d sigma = dV scale^2/(2 sigma). For a relative blur estimator, the error of the reference
      // is in all frames except the reference itself.
      const double error_px2 = is_edge                  ? kErrorPx2
                               : i == c.bench.reference ? 0
                                                        : std::sqrt(2) * kErrorPx2;
      const double s2 = std::pow(c.bench.Scale(depth_mm), 2);
      EXPECT_NEAR(frame.blur_sigma_error_px, error_px2 * s2 / (2 * sigma_px), 1e-5) << i;
    }
    EXPECT_FALSE(c.calibration.frames[0].in_blur_fit);
    EXPECT_EQ(c.calibration.frames[0].rejection, "dark: mean 1");
    EXPECT_EQ(c.calibration.diagnostics.blur.frames_used, c.bench.count);
  }
}

// If no blur is left, the error is that of the root of the variance.
TEST(SolveFocus, TheErrorOfNoBlurIsBounded) {
  BlurBench bench = ExactBench();
  bench.floor_px2 = 0;
  bench.first_mm = 340;
  bench.last_mm = 460;  // frame 15 is in the plane of focus
  FocusCase c = FocusCase(bench).WithKnifeEdge(kErrorPx2);
  c.evidence.setup.estimators[0].variances_px2[15] -= 1e-3;
  c.Solve();
  EXPECT_EQ(c.frame(15).blur_sigma_px, 0);
  const double s2 = std::pow(c.bench.Scale(400), 2);
  EXPECT_NEAR(c.frame(15).blur_sigma_error_px, std::sqrt(kErrorPx2 * s2), 1e-9);
}

// The readings scatter, and the estimated error of each is reported.
TEST(SolveFocus, ReadingErrorsAreReported) {
  BlurBench bench = thicklens::testing::WithReadings(0.1, 1e-5);
  bench.noise = 0;
  FocusCase c = FocusCase(bench).WithTexture(kErrorPx2).WithTrueFloor();
  c.Solve();
  ASSERT_EQ(c.calibration.summary.outcome, Outcome::kOk) << c.calibration.summary.reason;
  const double sign = model::DirectionSign(bench.direction);
  for (std::size_t i = 0; i < static_cast<std::size_t>(bench.count); ++i) {
    const double error_mm = c.frame(i).reading_mm - sign * (bench.Depth(i) - bench.offset_mm);
    EXPECT_NEAR(c.frame(i).reading_error_mm, error_mm, 4 * c.frame(i).reading_error_sigma_mm);
    EXPECT_GT(c.frame(i).reading_error_sigma_mm, 0);
    EXPECT_LT(c.frame(i).reading_error_sigma_mm, 0.1);
  }
}

TEST(SolveFocus, FramesThatNoMeterHasAreReportedAsUnused) {
  FocusCase c = Texture();
  Remove(0, &c.evidence.setup.estimators[0]);
  Remove(1, &c.evidence.setup.estimators[0]);
  Remove(2, &c.evidence.setup.estimators[0]);
  c.frame(1).image_scale.reset();
  c.frame(2).rejection = "blank";
  c.Solve();
  EXPECT_THAT(c.frame(0).not_in_fit, HasSubstr("blurred too strongly"));
  EXPECT_THAT(c.frame(1).not_in_fit, HasSubstr("could not be registered"));
  EXPECT_EQ(c.frame(2).not_in_fit, "");
  EXPECT_EQ(c.frame(3).not_in_fit, "");
  EXPECT_EQ(c.calibration.diagnostics.blur.frames_used, c.bench.count - 3);
  EXPECT_EQ(c.frame(0).rejection, "");
}

}  // namespace
}  // namespace thicklens::calib
