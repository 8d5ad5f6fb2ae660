#include "calib/calibrate/clipped_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <string>

#include "tests/calib/accuracy_bench.h"
#include "tests/calib/calibrated_sweep.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using namespace thicklens::testing;

constexpr double kFocusMm = 300;

// Frames of 1 mm around focus, of which those within `reach` steps are clipped the more the sharper
// they are.
std::vector<FrameMeasurement> Frames(int count, int reach) {
  std::vector<FrameMeasurement> frames(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    FrameMeasurement& frame = frames[static_cast<std::size_t>(i)];
    frame.depth_mm = kFocusMm + i - 0.5 * (count - 1) + 0.1;
    const double off = std::abs(i - 0.5 * (count - 1) + 0.1);
    if (off < reach) frame.statistics.saturated_fraction = 0.04 - 0.003 * off;
  }
  return frames;
}

std::vector<std::size_t> All(const std::vector<FrameMeasurement>& frames) {
  std::vector<std::size_t> all(frames.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  return all;
}

TEST(ClippedFrames, AreLeftOutWhereTheOthersSuffice) {
  const std::vector<FrameMeasurement> frames = Frames(21, 2);
  const ClippedFrames clipped = ChooseClippedFrames(frames, All(frames), kFocusMm);
  EXPECT_THAT(clipped.left_out, ElementsAre(10, 9, 11, 8));
  EXPECT_THAT(clipped.kept, IsEmpty());
}

TEST(ClippedFrames, AHalfAndBothSidesOfFocusStay) {
  std::vector<FrameMeasurement> frames = Frames(21, 8);
  ClippedFrames clipped = ChooseClippedFrames(frames, All(frames), kFocusMm);
  EXPECT_EQ(clipped.left_out.size(), 10u);
  EXPECT_FALSE(clipped.kept.empty());
  // The most clipped ones go first.
  EXPECT_EQ(clipped.left_out.front(), 10u);
  EXPECT_THAT(clipped.kept, Not(Contains(9u)));
  // The exposure rises along the sweep: all frames behind focus are clipped.
  frames = Frames(21, 0);
  for (std::size_t i = 10; i < 21; ++i)
    frames[i].statistics.saturated_fraction = 0.001 * static_cast<double>(i);
  clipped = ChooseClippedFrames(frames, All(frames), kFocusMm);
  EXPECT_EQ(clipped.left_out.size(), 8u);
  EXPECT_EQ(clipped.kept.size(), 3u);
  // A short sweep keeps its frames.
  frames = Frames(9, 3);
  EXPECT_THAT(ChooseClippedFrames(frames, All(frames), kFocusMm).left_out, IsEmpty());
}

TEST(ClippedFrames, KeptOnesWidenTheIntervalOfTheBlurRatio) {
  Calibration c;
  c.summary.blur_ratio = Result{0.45, 0.001, Eigen::Vector2d(0.449, 0.451)};
  c.frames = Frames(5, 1);
  ClippedFrames clipped;
  clipped.kept = {2};
  WidenByClipping(clipped, &c);  // the frame is not in the fit
  EXPECT_TRUE(c.diagnostics.systematic_parts.empty());
  c.frames[2].in_blur_fit = true;
  WidenByClipping(clipped, &c);
  ASSERT_EQ(c.diagnostics.systematic_parts.size(), 1u);
  EXPECT_NEAR(c.summary.blur_ratio->systematic->x(), 0.449 - 0.45 * 0.04, 3e-4);
  EXPECT_NEAR(c.summary.blur_ratio->systematic->y(), 0.451 + 0.45 * 0.04, 3e-4);
}

SimulatedSweep Speckle(std::uint64_t seed, double level) {
  model::SweepSimulationOptions options = AccuracyBench(seed);
  options.target.kind = model::TargetKind::kGroundGlass;
  options.light_level = level;
  SimulatedSweep s = Simulate(options);
  GiveDrawnFloor(&s, seed);
  return s;
}

// The grains of speckle have up to several times the mean light. Clipped frames in the fit moved
// kappa by 4.1 of its standard deviations in this sweep.
TEST(ClippedFrames, TheBlurRatioOfClippedSpeckleIsWithinItsErrors) {
  const SimulatedSweep s = Speckle(2800003, 0.5);
  const Calibration c = CalibrateWithoutMap(s);
  ASSERT_EQ(c.summary.outcome, Outcome::kOk) << c.summary.reason;
  EXPECT_NEAR(c.summary.blur_ratio->value, 0.45, 2.5 * c.summary.blur_ratio->sigma);
  EXPECT_LT(c.summary.blur_ratio->sigma, 0.005 * 0.45);
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("bright places are clipped in")));
  for (const FrameMeasurement& frame : c.frames) {
    if (!frame.rejection.empty()) continue;
    if (frame.statistics.saturated_fraction > 0) {
      EXPECT_FALSE(frame.in_blur_fit) << frame.image;
      EXPECT_THAT(frame.not_in_fit, HasSubstr("clipped at 65535")) << frame.image;
    } else {
      EXPECT_THAT(frame.not_in_fit, Not(HasSubstr("clipped"))) << frame.image;
    }
  }
}

TEST(ClippedFrames, ADarkerSweepHasNone) {
  const Calibration c = CalibrateWithoutMap(Speckle(2800003, 0.12));
  ASSERT_EQ(c.summary.outcome, Outcome::kOk) << c.summary.reason;
  EXPECT_THAT(c.summary.warnings, Each(Not(HasSubstr("clipped"))));
  EXPECT_NEAR(c.summary.blur_ratio->value, 0.45, 2.5 * c.summary.blur_ratio->sigma);
}

// chi^2 of kappa over independent sweeps; 99.9 % of such sums are below 26.1 for 8 sweeps.
TEST(ClippedFrames, SlowTheErrorsOfClippedSpeckleAreTheScatter) {
  double chi2 = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const Calibration c = CalibrateWithoutMap(Speckle(2800000 + seed, 0.5));
    ASSERT_EQ(c.summary.outcome, Outcome::kOk) << c.summary.reason;
    chi2 += std::pow((c.summary.blur_ratio->value - 0.45) / c.summary.blur_ratio->sigma, 2);
  }
  EXPECT_LT(chi2, 26.1);
  EXPECT_GT(chi2, 1.3);
}

}  // namespace
}  // namespace thicklens::calib
