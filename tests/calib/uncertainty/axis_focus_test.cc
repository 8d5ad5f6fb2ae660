// The results of a curved field are moved from its mean to the axis.
#include "calib/uncertainty/axis_focus.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

namespace thicklens::calib {
namespace {

constexpr double kF1Mm = 50, kF2Mm = 54, kThicknessMm = 2;
const model::ThickLens kLens{kF1Mm, kF2Mm, kThicknessMm, 9};
constexpr double kBeforeMm = 300, kMoveMm = -2.5, kMoveSigmaMm = 0.4;
constexpr double kFocusSigmaMm = 0.3, kRatio = 0.45, kRatioSigma = 0.002, kCorrelation = 0.6;

// d1 from Ap of an object at zf, by the conjugate equation of an equivalent thin lens.
double DistanceMm(double zf) { return kThicknessMm + kF2Mm * zf / (zf - kF1Mm); }
// The blur of a frame is proportional to kappa K.
double ScaleMm(double zf) { return kF1Mm * zf / (zf - kF1Mm); }

Calibration Found() {
  Calibration found;
  const double slope = -kF1Mm * kF2Mm / std::pow(kBeforeMm - kF1Mm, 2);
  const double d1_mm = DistanceMm(kBeforeMm), d1_sigma = std::abs(slope) * kFocusSigmaMm;
  found.summary.focus_depth_mm = Result{kBeforeMm, kFocusSigmaMm, Eigen::Vector2d(299, 302)};
  found.summary.image_distance_mm =
      Result{d1_mm, d1_sigma, Eigen::Vector2d(d1_mm - 0.08, d1_mm + 0.04)};
  found.summary.blur_ratio = Result{kRatio, kRatioSigma, Eigen::Vector2d(0.44, 0.47)};
  found.diagnostics.focus_reading_mm = model::Estimate{-20, 0.1};
  found.diagnostics.magnification_at_focus = model::Estimate{kF1Mm / (kBeforeMm - kF1Mm), 1e-4};
  found.diagnostics.covariance_order = {"image_distance_mm", "blur_ratio", "bench_offset_mm"};
  const Eigen::Vector3d sigmas(d1_sigma, kRatioSigma, 0.2);
  Eigen::Matrix3d correlations = Eigen::Matrix3d::Identity();
  correlations(0, 1) = correlations(1, 0) = -kCorrelation;  // d1 falls where zf grows
  correlations(0, 2) = correlations(2, 0) = -0.5;
  correlations(1, 2) = correlations(2, 1) = 0.5 * kCorrelation;
  found.diagnostics.covariance = sigmas.asDiagonal() * correlations * sigmas.asDiagonal();
  SystematicPart part;
  part.focus_depth_mm = {-1, 2};
  part.image_distance_mm = {-0.08, 0.04};
  found.diagnostics.systematic_parts.push_back(part);
  return found;
}

TEST(AxisFocus, TheResultsBelongToTheAxis) {
  Calibration found = Found();
  MoveFocus({kMoveMm, kMoveSigmaMm}, -1, kLens, &found);
  const double zf = kBeforeMm + kMoveMm;
  const CalibrationSummary& summary = found.summary;
  EXPECT_DOUBLE_EQ(summary.focus_depth_mm->value, zf);
  EXPECT_NEAR(summary.focus_depth_mm->sigma, 0.5, 1e-12);
  EXPECT_NEAR(summary.image_distance_mm->value, DistanceMm(zf), 1e-12);
  EXPECT_NEAR(summary.blur_ratio->value * ScaleMm(zf), kRatio * ScaleMm(kBeforeMm), 1e-12);
  EXPECT_EQ(*summary.focus_depth_mm->systematic, Eigen::Vector2d(299 + kMoveMm, 302 + kMoveMm));
  // An end of an interval is as far from the value as before; d1 has another slope there.
  const double stretch = std::pow((kBeforeMm - kF1Mm) / (zf - kF1Mm), 2);
  EXPECT_NEAR(summary.image_distance_mm->systematic->x(), DistanceMm(zf) - 0.08 * stretch, 1e-9);
  EXPECT_NEAR(summary.image_distance_mm->systematic->y(), DistanceMm(zf) + 0.04 * stretch, 1e-9);
  EXPECT_NEAR(found.diagnostics.systematic_parts[0].image_distance_mm.y(), 0.04 * stretch, 1e-9);
  EXPECT_EQ(found.diagnostics.systematic_parts[0].focus_depth_mm, Eigen::Vector2d(-1, 2));
  // A reading that falls as the depth grows.
  EXPECT_DOUBLE_EQ(found.diagnostics.focus_reading_mm->value, -20 - kMoveMm);
  EXPECT_NEAR(found.diagnostics.focus_reading_mm->sigma, std::hypot(0.1, kMoveSigmaMm), 1e-12);
  EXPECT_NEAR(found.diagnostics.magnification_at_focus->value, kF1Mm / (zf - kF1Mm), 1e-12);
  EXPECT_NEAR(found.diagnostics.magnification_at_focus->sigma,
              kF1Mm * 0.5 / std::pow(zf - kF1Mm, 2), 1e-12);
}

// The covariance of drawn values: zf, kappa and the offset of a fit, and an independent move.
TEST(AxisFocus, TheCovarianceIsThatOfDrawnResults) {
  Calibration found = Found();
  MoveFocus({kMoveMm, kMoveSigmaMm}, 1, kLens, &found);
  std::mt19937_64 engine(38);
  std::normal_distribution<double> normal;
  constexpr int kDraws = 200000;
  Eigen::MatrixXd drawn(kDraws, 3);
  for (int i = 0; i < kDraws; ++i) {
    const double u = normal(engine), v = normal(engine), w = normal(engine);
    const double zf_error = kFocusSigmaMm * u;
    const double kappa =
        kRatio + kRatioSigma * (kCorrelation * u + std::sqrt(1 - kCorrelation * kCorrelation) * v);
    const double zf = kBeforeMm + zf_error + kMoveMm + kMoveSigmaMm * normal(engine);
    drawn.row(i) << DistanceMm(zf), kappa * ScaleMm(kBeforeMm + zf_error) / ScaleMm(zf),
        0.2 * (0.5 * u + std::sqrt(0.75) * w);
  }
  const Eigen::MatrixXd centred = drawn.rowwise() - drawn.colwise().mean();
  const Eigen::Matrix3d expected = centred.transpose() * centred / (kDraws - 1.0);
  const Eigen::Vector3d sigmas = expected.diagonal().cwiseSqrt();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      EXPECT_NEAR(found.diagnostics.covariance(row, column), expected(row, column),
                  0.012 * sigmas[row] * sigmas[column])
          << row << " " << column;
    }
  }
  EXPECT_NEAR(found.summary.image_distance_mm->sigma, sigmas[0], 0.01 * sigmas[0]);
  EXPECT_NEAR(found.summary.blur_ratio->sigma, sigmas[1], 0.01 * sigmas[1]);
}

// Results that are absent stay so.
TEST(AxisFocus, ASweepWithoutAReadingAtFocusHasNone) {
  Calibration found;
  found.summary.focus_depth_mm = Result{kBeforeMm, kFocusSigmaMm, std::nullopt};
  found.summary.image_distance_mm = Result{DistanceMm(kBeforeMm), 0.01, std::nullopt};
  MoveFocus({kMoveMm, kMoveSigmaMm}, 1, kLens, &found);
  EXPECT_NEAR(found.summary.image_distance_mm->value, DistanceMm(kBeforeMm + kMoveMm), 1e-12);
  EXPECT_FALSE(found.summary.focus_depth_mm->systematic);
  EXPECT_FALSE(found.summary.blur_ratio);
  EXPECT_FALSE(found.diagnostics.focus_reading_mm);
  EXPECT_EQ(found.diagnostics.covariance.size(), 0);
}

}  // namespace
}  // namespace thicklens::calib
