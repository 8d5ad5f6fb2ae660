// Calibrations of sweeps with shading and dust that are fixed to the frame.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>

#include "tests/calib/calibrated_sweep.h"
#include "tests/calib/damaged_sweep.h"
#include "tests/calib/tracked_sweep.h"

namespace thicklens::calib {
namespace {

using ::testing::AnyOf;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Not;
using namespace thicklens::testing;

constexpr int kSizePx = 320;

SimulatedSweep OpenZero(std::uint64_t seed) {
  SimulatedSweep s = SweepWithFloor("ii", kSizePx, seed);
  s.sweep.offset_mm.reset();
  return s;
}

// 1/(1 + a r^2)^2, with that value at the corners.
cv::Mat GainOfCorner(double corner) {
  cv::Mat gain(kSizePx, kSizePx, CV_32F);
  const double middle = 0.5 * (kSizePx - 1),
               a = (1 / std::sqrt(corner) - 1) / (2 * middle * middle);
  for (int y = 0; y < kSizePx; ++y) {
    for (int x = 0; x < kSizePx; ++x) {
      const double r2 = std::pow(x - middle, 2) + std::pow(y - middle, 2);
      gain.at<float>(y, x) = static_cast<float>(std::pow(1 + a * r2, -2));
    }
  }
  return gain;
}

void ExpectAsGoodAsClean(const Calibration& clean, const Calibration& c, const SimulatedSweep& s) {
  ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  const Result& zf = *c.summary.focus_depth_mm;
  EXPECT_LT(zf.sigma, 1.5 * clean.summary.focus_depth_mm->sigma);
  EXPECT_NEAR(zf.value, s.truth.focus_depth_mm, 4 * zf.sigma);
  EXPECT_NEAR(zf.value, clean.summary.focus_depth_mm->value,
              1.5 * clean.summary.focus_depth_mm->sigma);
  EXPECT_NEAR(c.summary.blur_ratio->value, s.truth.blur_ratio, 4 * c.summary.blur_ratio->sigma);
  EXPECT_THAT(c.summary.warnings, Each(Not(AnyOf(HasSubstr("bend"), HasSubstr("distort")))));
}

TEST(FixedPattern, ACleanSweepIsNotChanged) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const Calibration c = CalibrateWithoutMap(OpenZero(seed));
    ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
    EXPECT_TRUE(c.diagnostics.fixed_pattern.measured);
    EXPECT_FALSE(c.diagnostics.fixed_pattern.Removed()) << c.diagnostics.fixed_pattern.InWords();
    EXPECT_EQ(c.diagnostics.fixed_pattern.InWords(), "");
  }
}

TEST(FixedPattern, DarkCornersAreDividedOut) {
  const SimulatedSweep even = OpenZero(2);
  const Calibration clean = CalibrateWithoutMap(even);
  for (const double stops : {-1.0, -2.0}) {
    SimulatedSweep s = DeepCopy(even);
    MultiplyLight(&s, GainOfCorner(std::exp2(stops)));
    const Calibration c = CalibrateWithoutMap(s);
    const FixedPattern& pattern = c.diagnostics.fixed_pattern;
    ASSERT_TRUE(pattern.shading_removed) << pattern.message;
    EXPECT_NEAR(pattern.corner_stops->value, stops, 4 * pattern.corner_stops->sigma + 0.05);
    EXPECT_THAT(pattern.InWords(), HasSubstr("stops from the centre to the corners"));
    ExpectAsGoodAsClean(clean, c, s);
  }
}

TEST(FixedPattern, SpecksAreRemovedAndCounted) {
  const SimulatedSweep even = OpenZero(3);
  const Calibration clean = CalibrateWithoutMap(even);
  for (std::uint32_t seed = 1; seed <= 2; ++seed) {
    SimulatedSweep s = DeepCopy(even);
    MultiplyLight(&s, GainOfSpecks({kSizePx, kSizePx}, 10, 0.4, seed));
    const Calibration c = CalibrateWithoutMap(s);
    const FixedPattern& pattern = c.diagnostics.fixed_pattern;
    EXPECT_GE(pattern.specks, 7);
    EXPECT_LE(pattern.specks, 10);
    EXPECT_THAT(pattern.InWords(), HasSubstr("specks"));
    EXPECT_GT(pattern.divided_share, 0.003);
    EXPECT_LT(pattern.divided_share + pattern.filled_share, 0.05);
    ExpectAsGoodAsClean(clean, c, s);
  }
}

TEST(FixedPattern, BothAtOnceAreRemoved) {
  const SimulatedSweep even = OpenZero(4);
  const Calibration clean = CalibrateWithoutMap(even);
  SimulatedSweep s = DeepCopy(even);
  MultiplyLight(&s, GainOfCorner(0.4).mul(GainOfSpecks({kSizePx, kSizePx}, 8, 0.4, 5)));
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_TRUE(c.diagnostics.fixed_pattern.shading_removed);
  EXPECT_GE(c.diagnostics.fixed_pattern.specks, 5);
  ExpectAsGoodAsClean(clean, c, s);
}

}  // namespace
}  // namespace thicklens::calib
