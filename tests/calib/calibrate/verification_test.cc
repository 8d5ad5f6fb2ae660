// Statistics that decide whether a stored calibration is still valid, tested with numbers that can
// be computed by hand. Simulated sweeps are tested in tests/tools/commands/camera_verify_test.cc.
#include "thicklens/calib/verification.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "support/test_cameras.h"
#include "thicklens/base/error.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using thicklens::testing::CentredSensor;
using thicklens::testing::TestCamera;
using thicklens::testing::ThinLens;
using thicklens::testing::WithMethod;

constexpr double kD1Mm = 60, kRatio = 0.45;

// A lens of 50 mm at f/2.8 with d1 = 60 mm.
model::Camera StoredCamera(double d1_sigma, double ratio_sigma) {
  return WithMethod(TestCamera("stored", ThinLens(50, 50 / (2 * 2.8)),
                               CentredSensor(512, 512, 0.0045, model::TransferCurve::Linear()),
                               {kD1Mm, d1_sigma}, {kRatio, ratio_sigma}),
                    "joint-blur-fit");
}

Calibration FoundCalibration(double d1_mm, double d1_sigma, double ratio, double ratio_sigma) {
  Calibration found;
  found.summary.outcome = Outcome::kOk;
  found.summary.image_distance_mm = Result{d1_mm, d1_sigma, std::nullopt};
  const model::ThickLens lens = StoredCamera(0, 0).lens;
  const double zf = model::FocusDepthMm(lens, d1_mm);
  found.summary.focus_depth_mm =
      Result{zf, d1_sigma / std::abs(model::ImageDistanceSlope(lens, zf)), std::nullopt};
  found.summary.blur_ratio = Result{ratio, ratio_sigma, std::nullopt};
  found.diagnostics.covariance_order = {"image_distance_mm", "blur_ratio"};
  found.diagnostics.covariance =
      Eigen::Vector2d(d1_sigma * d1_sigma, ratio_sigma * ratio_sigma).asDiagonal();
  return found;
}

const ComparedParameter& Named(const Verification& verification, const std::string& name) {
  for (const ComparedParameter& parameter : verification.parameters) {
    if (parameter.name == name) return parameter;
  }
  ADD_FAILURE() << name << " is not there";
  static const ComparedParameter none;
  return none;
}

// The quantiles are from published tables of the chi-square distribution.
TEST(ChiSquare, AgreesWithPublishedQuantiles) {
  EXPECT_NEAR(ChiSquareTail(3.841459, 1), 0.05, 1e-7);
  EXPECT_NEAR(ChiSquareTail(5.991465, 2), 0.05, 1e-7);
  EXPECT_NEAR(ChiSquareTail(7.814728, 3), 0.05, 1e-7);
  EXPECT_NEAR(ChiSquareTail(13.276704, 4), 0.01, 1e-7);
  EXPECT_NEAR(ChiSquareTail(124.342113, 100), 0.05, 1e-7);
  EXPECT_EQ(ChiSquareTail(0, 3), 1);
  EXPECT_NEAR(ChiSquareExceeded(0.01, 4), 13.276704, 1e-5);
  EXPECT_NEAR(ChiSquareExceeded(0.0026997961, 1), 9, 1e-5);  // three sigma
}

TEST(VerifyCalibration, AddsTheVariancesOfBoth) {
  // The change is 0.004 mm, with sigmas of 0.003 and 0.004 mm, or 0.001 mm with a sigma of 0.001 mm
  // only.
  const Verification result =
      VerifyCalibration(StoredCamera(0.003, 0), {},
                        FoundCalibration(kD1Mm + 0.004, 0.004, kRatio + 0.001, 0.001), {});
  EXPECT_EQ(result.verdict, Verdict::kHolds) << result.reason;
  EXPECT_EQ(result.degrees_of_freedom, 2);
  EXPECT_NEAR(Named(result, "image_distance_mm").deviation(), 0.8, 1e-9);
  EXPECT_NEAR(Named(result, "blur_ratio").deviation(), 1, 1e-9);
  EXPECT_NEAR(result.chi_square, 0.64 + 1, 1e-8);
  EXPECT_NEAR(result.p_value, std::exp(-0.82), 1e-8);
  EXPECT_FALSE(Named(result, "focus_depth_mm").counted);
  // zf moves in the opposite direction to d1, by as many sigmas except for the curvature of [S13].
  EXPECT_NEAR(Named(result, "focus_depth_mm").deviation(), -0.8, 0.01);
  ASSERT_THAT(result.warnings, SizeIs(1));
  EXPECT_THAT(result.warnings[0], HasSubstr("blur_ratio: these values are treated as exact"));
}

TEST(VerifyCalibration, AChangeOfFiveSigmaIsFound) {
  const Verification result =
      VerifyCalibration(StoredCamera(0.003, 0.003), {},
                        FoundCalibration(kD1Mm + 5 * 0.005, 0.004, kRatio, 0.004), {});
  EXPECT_EQ(result.verdict, Verdict::kDoesNotHold);
  EXPECT_NEAR(result.chi_square, 25, 1e-6);
  EXPECT_THAT(result.reason, HasSubstr("image_distance_mm 60.025, stored 60 (+5.0 sigma)"));
}

// A magnification gives d1, which the sweep then does not measure; kappa is compared.
TEST(VerifyCalibration, AStatedPlaneOfFocusIsNoMeasurementOfTheImageDistance) {
  Calibration found = FoundCalibration(kD1Mm + 1, 0.004, kRatio + 0.001, 0.001);
  found.summary.bench_offset_mm = Result{190, 0.1, std::nullopt};
  found.diagnostics.bench_offset_from = "magnification";
  Verification result = VerifyCalibration(StoredCamera(0.003, 0.001), {}, found, {});
  EXPECT_EQ(result.verdict, Verdict::kUndetermined);
  EXPECT_THAT(result.reason, HasSubstr("it follows from magnification, which is stated"));
  EXPECT_FALSE(Named(result, "image_distance_mm").counted);
  EXPECT_EQ(Named(result, "image_distance_mm").why_not_counted,
            "it follows from magnification, which is stated");
  EXPECT_TRUE(Named(result, "blur_ratio").counted);
  EXPECT_THAT(result.warnings, IsEmpty());
  found.diagnostics.bench_offset_from = "the image scale";
  result = VerifyCalibration(StoredCamera(0.003, 0.001), {}, found, {});
  EXPECT_EQ(result.verdict, Verdict::kDoesNotHold);
}

// Both matrices are correlated. A difference along the direction in which both are uncertain is not
// significant; a difference across it is.
TEST(VerifyCalibration, UsesTheCorrelationOfBothMatrices) {
  model::Camera stored = StoredCamera(0.01, 0.01);
  stored.calibration->covariance_order = {"blur_ratio", "image_distance_mm"};  // another order
  stored.calibration->covariance = (Eigen::Matrix2d() << 1e-4, 0.9e-4, 0.9e-4, 1e-4).finished();
  Calibration along = FoundCalibration(kD1Mm + 0.02, 0.01, kRatio + 0.02, 0.01);
  along.diagnostics.covariance = (Eigen::Matrix2d() << 1e-4, 0.9e-4, 0.9e-4, 1e-4).finished();
  Calibration across = along;
  across.summary.blur_ratio->value = kRatio - 0.02;
  // C = 2e-4 [1 0.9; 0.9 1]: d^2/(2e-4)/(1 +- 0.9) * 2.
  const Verification one = VerifyCalibration(stored, {}, along, {});
  const Verification other = VerifyCalibration(stored, {}, across, {});
  EXPECT_NEAR(one.chi_square, 2 * 4e-4 / 2e-4 / 1.9, 1e-8);
  EXPECT_NEAR(other.chi_square, 2 * 4e-4 / 2e-4 / 0.1, 1e-8);
  EXPECT_EQ(other.verdict, Verdict::kDoesNotHold);
}

// An unknown bench offset leaves d1 undetermined. If the camera has not moved on the bench, the
// joint information about both counts.
TEST(VerifyCalibration, TheBenchZeroIsComparedWhereTheCameraHasNotMoved) {
  model::Camera stored = StoredCamera(0.01, 0.001);
  stored.calibration->bench_offset_mm = model::Estimate{100, 1};
  stored.calibration->covariance_order = {"image_distance_mm", "blur_ratio", "bench_offset_mm"};
  const double covariance = -0.999 * 0.01 * 1;
  Eigen::Matrix3d matrix = Eigen::Vector3d(1e-4, 1e-6, 1).asDiagonal();
  matrix(0, 2) = matrix(2, 0) = covariance;
  stored.calibration->covariance = matrix;
  // Only d1 is off, by one sigma, and the bench offset is the same.
  Calibration found = FoundCalibration(kD1Mm + std::sqrt(2.0) * 0.01, 0.01, kRatio, 0.001);
  found.summary.bench_offset_mm = Result{100, 1, std::nullopt};
  found.diagnostics.covariance_order = stored.calibration->covariance_order;
  found.diagnostics.covariance = matrix;
  const Verification moved = VerifyCalibration(stored, {}, found, {});
  EXPECT_NEAR(moved.chi_square, 1, 1e-8);
  EXPECT_THAT(Named(moved, "bench_offset_mm").why_not_counted,
              HasSubstr("position of the camera on the bench"));
  VerificationOptions options;
  options.same_bench = true;
  const Verification same = VerifyCalibration(stored, {}, found, options);
  EXPECT_EQ(same.degrees_of_freedom, 3);
  // The correlation matrix [1 -0.999; -0.999 1] gives 1/(1 - 0.999^2).
  EXPECT_NEAR(same.chi_square, 1 / (1 - 0.999 * 0.999), 1e-4);
  EXPECT_EQ(same.verdict, Verdict::kDoesNotHold);
  // Values that are stated for the sweep are not measured by it.
  FocusSweep stated;
  stated.offset_mm = model::Estimate{100, 0.1};
  EXPECT_EQ(VerifyCalibration(stored, stated, found, options).degrees_of_freedom, 2);
}

TEST(VerifyCalibration, SystematicPartsOfTheNewSweepWidenWhatTheCameraFileDoesNotCause) {
  Calibration found = FoundCalibration(kD1Mm + 0.01, 0.001, kRatio, 0.001);
  SystematicPart floor, focal;
  floor.name = "blur floor";
  floor.image_distance_mm = {-0.01, 0.02};
  focal.name = "lens.front_focal_length_mm";
  focal.image_distance_mm = {-1, 1};
  found.diagnostics.systematic_parts = {floor, focal};
  const Verification result = VerifyCalibration(StoredCamera(0.001, 0.001), {}, found, {});
  const ComparedParameter& d1 = Named(result, "image_distance_mm");
  EXPECT_NEAR(d1.systematic_sigma, 0.03 / std::sqrt(12.0), 1e-12);
  EXPECT_NEAR(d1.sigma, std::sqrt(2e-6 + 0.0009 / 12), 1e-12);
  found.diagnostics.systematic_parts.clear();
  EXPECT_EQ(VerifyCalibration(StoredCamera(0.001, 0.001), {}, found, {}).verdict,
            Verdict::kDoesNotHold);
}

// A change as large as the stated smallest detectable one is found in at least 95 % of the cases,
// and not in many more.
TEST(VerifyCalibration, TheSmallestDetectableChangeIsFoundAsOftenAsItSays) {
  const model::Camera stored = StoredCamera(0.003, 0.001);
  const double detectable =
      Named(VerifyCalibration(stored, {}, FoundCalibration(kD1Mm, 0.004, kRatio, 0.002), {}),
            "image_distance_mm")
          .smallest_detectable;
  EXPECT_NEAR(detectable, (std::sqrt(-2 * std::log(0.0027)) + 1.645) * 0.005, 1e-6);
  std::mt19937 engine(11);
  std::normal_distribution<double> normal;
  int found = 0;
  constexpr int kTrials = 4000;
  for (int i = 0; i < kTrials; ++i) {
    const double d1 = kD1Mm + detectable + 0.005 * normal(engine);
    const double ratio = kRatio + std::hypot(0.001, 0.002) * normal(engine);
    if (VerifyCalibration(stored, {}, FoundCalibration(d1, 0.004, ratio, 0.002), {}).verdict ==
        Verdict::kDoesNotHold) {
      ++found;
    }
  }
  EXPECT_GE(found, 0.945 * kTrials);
  EXPECT_LE(found, 0.98 * kTrials);
}

TEST(VerifyCalibration, WhatWouldNotShowAChangeCannotTell) {
  // For this lens the change is kappa r (1 - f1/zf)/(f2 p) px per mm of d1.
  const Verification coarse = VerifyCalibration(StoredCamera(0.001, 0.001), {},
                                                FoundCalibration(kD1Mm, 0.05, kRatio, 0.001), {});
  EXPECT_EQ(coarse.verdict, Verdict::kUndetermined);
  const double px_per_mm = kRatio * (50 / 5.6) * (1 - 50.0 / 300) / (50 * 0.0045);
  const double detectable = Named(coarse, "image_distance_mm").smallest_detectable;
  EXPECT_NEAR(coarse.detectable_blur_px, px_per_mm * detectable, 1e-6);
  EXPECT_THAT(coarse.reason, HasSubstr("a change of 0.5 px must be detectable"));
  const Verification ratio = VerifyCalibration(StoredCamera(0.001, 0.001), {},
                                               FoundCalibration(kD1Mm, 0.001, kRatio, 0.05), {});
  EXPECT_EQ(ratio.verdict, Verdict::kUndetermined);
  EXPECT_THAT(ratio.reason, HasSubstr("blur_ratio"));
}

TEST(VerifyCalibration, ASweepIsComparedInWhatItDetermines) {
  Calibration found = FoundCalibration(kD1Mm, 0.002, kRatio, 0.001);
  found.summary.blur_ratio.reset();
  const Verification result = VerifyCalibration(StoredCamera(0.001, 0.001), {}, found, {});
  EXPECT_EQ(result.verdict, Verdict::kHolds) << result.reason;
  EXPECT_EQ(result.degrees_of_freedom, 1);
  found.summary.outcome = Outcome::kRefused;
  found.summary.reason = "too few frames";
  const Verification refused = VerifyCalibration(StoredCamera(0.001, 0.001), {}, found, {});
  EXPECT_EQ(refused.verdict, Verdict::kUndetermined);
  EXPECT_THAT(refused.reason, HasSubstr("too few frames"));
  EXPECT_THAT(refused.parameters, IsEmpty());
}

TEST(VerifyCalibration, RefusesWhatCannotBeMeant) {
  model::Camera none = StoredCamera(0.001, 0.001);
  none.calibration.reset();
  EXPECT_THROW(VerifyCalibration(none, {}, {}, {}), Error);
  VerificationOptions options;
  options.significance = 1;
  std::string why;
  EXPECT_FALSE(options.IsValid(&why));
  EXPECT_THAT(why, HasSubstr("significance is 1"));
  EXPECT_THROW(VerifyCalibration(StoredCamera(0.001, 0.001), {}, {}, options), Error);
}

}  // namespace
}  // namespace thicklens::calib
