// The laws along x and along y are compared with blur that is drawn from two known laws.
#include "calib/fit/axial_focus.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;

constexpr double kXMm = 297, kYMm = 303, kRatioX = 0.45, kRatioY = 0.43;
constexpr double kOffset = 190, kFloor = 0.25;
constexpr int kFrames = 25;

struct AxialCase {
  BlurFitSetup setup;
  std::vector<std::size_t> frames;
  AxialBlur blur;
};

// sigma = kappa r/p f zf/(zf - f) |1/z - 1/zf| on the sensor [S26]; V is relative to the reference.
double TruthPx2(double zf_mm, double ratio, double depth_mm, double scale) {
  const double sigma_px =
      ratio * 8.9286 / 0.0045 * 50 * zf_mm / (zf_mm - 50) * (1 / depth_mm - 1 / zf_mm);
  return (kFloor + sigma_px * sigma_px) / (scale * scale);
}

AxialCase DrawAxialCase(unsigned seed, double blur_sigma_px2, double reading_sigma_mm) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  AxialCase c;
  c.setup.lens = {50, 50, 0, 8.9286};
  c.setup.pixel_pitch_mm = 0.0045;
  c.setup.offset_mm = {kOffset, 0};
  c.setup.reading_sigma_mm = reading_sigma_mm;
  c.setup.floor_variance_px2 = model::Estimate{kFloor, 0};
  c.blur.variances_px2.resize(2, kFrames);
  constexpr Eigen::Index kValues = Eigen::Index{2} * kFrames;
  c.blur.covariance = Eigen::MatrixXd::Zero(kValues, kValues);
  for (int i = 0; i < kFrames; ++i) {
    const double depth_mm = 288 + i;
    const double scale = 300 / depth_mm;
    c.setup.frames.push_back(
        {depth_mm - kOffset + reading_sigma_mm * normal(random), scale, std::nullopt});
    c.frames.push_back(static_cast<std::size_t>(i));
    const bool is_reference = i == 12;
    for (const int axis : {0, 1}) {
      const double truth_px2 = axis == 0 ? TruthPx2(kXMm, kRatioX, depth_mm, scale) + 0.7
                                         : TruthPx2(kYMm, kRatioY, depth_mm, scale) - 0.4;
      const double sigma_px2 = is_reference ? 0 : blur_sigma_px2 * (1 + 0.05 * truth_px2);
      c.blur.variances_px2(axis, i) = truth_px2 + sigma_px2 * normal(random);
      c.blur.covariance(2 * i + axis, 2 * i + axis) = sigma_px2 * sigma_px2;
    }
  }
  return c;
}

TEST(FitAxialFocus, FindsBothFoci) {
  const AxialCase c = DrawAxialCase(1, 1e-4, 0);
  const AxialFocus focus = FitAxialFocus(c.setup, c.frames, c.blur);
  ASSERT_TRUE(focus.done) << focus.message;
  EXPECT_NEAR(focus.focus_depth_mm[0].value, kXMm, 1e-3);
  EXPECT_NEAR(focus.focus_depth_mm[1].value, kYMm, 1e-3);
  EXPECT_NEAR(focus.blur_ratio[0].value, kRatioX, 1e-4);
  EXPECT_NEAR(focus.blur_ratio[1].value, kRatioY, 1e-4);
  EXPECT_NEAR(focus.difference_mm.value, kXMm - kYMm, 1e-3);
}

// The mean of both variances, with one kappa, follows one law about the focus with the mean power.
// Without its own minimum there, the law would find another one.
TEST(FitBlur, MeanOfBothAxesIsSmallestAtTheMedialFocus) {
  AxialCase c = DrawAxialCase(4, 1e-4, 0);
  BlurFitSetup setup = c.setup;
  BlurSamples samples;
  samples.frames = c.frames;
  samples.variances_px2.resize(kFrames);
  samples.covariance = 1e-8 * Eigen::MatrixXd::Identity(kFrames, kFrames);
  for (int i = 0; i < kFrames; ++i) {
    const double depth_mm = 288 + i, scale = 300 / depth_mm;
    // Both axes have one slope: that of the lens with the medial focus.
    constexpr double kMedialMm = 2 / (1 / kXMm + 1 / kYMm);
    const double medial_slope = kMedialMm / (kMedialMm - 50);
    double mean = 0;
    for (const double zf_mm : {kXMm, kYMm}) {
      const double ratio = kRatioX * medial_slope * (zf_mm - 50) / zf_mm;
      mean += 0.5 * TruthPx2(zf_mm, ratio, depth_mm, scale);
    }
    samples.variances_px2[i] = mean + 0.3;
  }
  setup.estimators = {samples};
  setup.half_astigmatism_per_mm = 0.5 * (1 / kXMm - 1 / kYMm);
  const BlurFitResult fit = FitBlur(setup);
  ASSERT_TRUE(fit.done) << fit.message;
  EXPECT_NEAR(fit.values[kFocusDepth], 2 / (1 / kXMm + 1 / kYMm), 1e-4);
  EXPECT_NEAR(fit.values[kBlurRatio], kRatioX, 1e-5);
  EXPECT_NEAR(fit.softness_px2[0], 0.3, 1e-3);
  setup.half_astigmatism_per_mm = 0;
  EXPECT_GT(std::abs(FitBlur(setup).values[kFocusDepth] - fit.values[kFocusDepth]), 0.01);
}

// A frame with a wrong reading loses its weight in both laws.
TEST(FitAxialFocus, AWrongReadingHasLittleEffect) {
  AxialCase c = DrawAxialCase(2, 0.02, 0.02);
  c.setup.frames[4].reading_mm += 1.5;
  const AxialFocus focus = FitAxialFocus(c.setup, c.frames, c.blur);
  ASSERT_TRUE(focus.done) << focus.message;
  EXPECT_NEAR(focus.difference_mm.value, kXMm - kYMm, 0.05);
  const std::vector<std::size_t> kept = SamplesOnParabolas(c.setup, c.frames, c.blur);
  EXPECT_EQ(kept.size(), c.frames.size() - 1);
  EXPECT_THAT(kept, ::testing::Not(::testing::Contains(4U)));
}

TEST(FitAxialFocus, BlurThatDoesNotChangeIsRefused) {
  AxialCase c = DrawAxialCase(3, 0.02, 0.02);
  // V falls on both sides of the middle.
  for (int i = 0; i < kFrames; ++i) c.blur.variances_px2(1, i) = -0.5 * std::abs(i - 12);
  const AxialFocus focus = FitAxialFocus(c.setup, c.frames, c.blur);
  EXPECT_FALSE(focus.done);
  EXPECT_THAT(focus.message, HasSubstr("along y"));
}

// The readings' errors move both foci by more than the blur's noise, and mostly cancel in the
// difference.
TEST(FitAxialFocus, SigmaIsTheScatterOverNoiseAndReadings) {
  constexpr int kRuns = 80;
  double difference = 0, depth = 0, ratio = 0, bias = 0, misfit = 0;
  for (unsigned run = 0; run < kRuns; ++run) {
    const AxialCase c = DrawAxialCase(100 + run, 0.02, 0.05);
    const AxialFocus focus = FitAxialFocus(c.setup, c.frames, c.blur);
    ASSERT_TRUE(focus.done) << focus.message;
    const auto squared = [](const model::Estimate& found, double truth) {
      return std::pow((found.value - truth) / found.sigma, 2) / kRuns;
    };
    difference += squared(focus.difference_mm, kXMm - kYMm);
    depth += squared(focus.focus_depth_mm[0], kXMm);
    ratio += squared(focus.blur_ratio[1], kRatioY);
    bias += (focus.difference_mm.value - (kXMm - kYMm)) / focus.difference_mm.sigma / kRuns;
    misfit += focus.chi2_per_dof / kRuns;
    EXPECT_LT(focus.difference_mm.sigma,
              0.8 * std::hypot(focus.focus_depth_mm[0].sigma, focus.focus_depth_mm[1].sigma));
  }
  // chi^2 of 80 draws is within these limits in 998 of 1000 cases. The errors are widened where
  // chi^2 of a fit is above 1, so that they are somewhat too large.
  for (const double squares : {difference, depth, ratio}) {
    EXPECT_GT(squares, 0.5);
    EXPECT_LT(squares, 1.56);
  }
  EXPECT_NEAR(bias, 0, 3.3 / std::sqrt(kRuns));
  EXPECT_NEAR(misfit, 1, 0.1);
}

}  // namespace
}  // namespace thicklens::calib
