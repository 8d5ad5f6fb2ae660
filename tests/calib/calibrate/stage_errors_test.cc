// Calibrations of sweeps whose stage has backlash, a periodic screw error, lost steps, or coarse
// readings, from the simulator: results, and what is named.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <utility>

#include "tests/calib/calibrated_sweep.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using namespace thicklens::testing;

// A sweep of configs/sweeps there and back, with 42 frames.
SimulatedSweep Bench(const model::StageOptions& stage, std::uint64_t seed,
                     bool knows_zero = false) {
  model::SweepSimulationOptions options = SweepCase("ii", 256, seed);
  const double range_mm = options.step_mm * (options.frame_count - 1);
  options.frame_count = 42;
  options.step_mm = range_mm / (stage.there_and_back ? 20 : 41);
  options.reading_sigma_mm = 0.05;
  options.stage = stage;
  SimulatedSweep s = Simulate(options);
  GiveFloor(&s);
  if (!knows_zero) s.sweep.offset_mm.reset();
  return s;
}

// A sweep at 1:1, whose scale shows the readings worse than its blur does.
SimulatedSweep Macro(const model::StageOptions& stage, std::uint64_t seed) {
  model::SweepSimulationOptions options = SweepCase("ii", 384, seed);
  options.camera.lens = {45, 45, 0, 4.6};
  options.camera.sensor.pixel_pitch_mm = 0.00345;
  options.camera.calibration->image_distance_mm =
      model::Estimate{model::ImageDistanceMm(options.camera.lens, 56.25), 0};
  options.frame_count = 40;
  options.step_mm = 0.05;
  options.first_depth_mm = 56.25 - 9.7 * options.step_mm;
  options.bench_offset_mm = 40;
  options.reading_sigma_mm = 0.001;
  options.bits = 16;
  options.stage = stage;
  SimulatedSweep s = Simulate(options);
  s.sweep.offset_mm.reset();
  s.sweep.stated_focus.push_back(
      {model::ConjugateKind::kFocusDepth, {56.25, 0.01}, "focus_depth_mm"});
  GiveFloor(&s);
  return s;
}

bool Covers(const Result& result, double truth) {
  const double low = result.systematic ? result.systematic->x() : result.value;
  const double high = result.systematic ? result.systematic->y() : result.value;
  return truth > low - 2 * result.sigma && truth < high + 2 * result.sigma;
}

void ExpectCovered(const Calibration& c, const SimulatedSweep& s) {
  ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  EXPECT_TRUE(Covers(*c.summary.focus_depth_mm, s.truth.focus_depth_mm))
      << c.summary.focus_depth_mm->value << " for " << s.truth.focus_depth_mm;
  EXPECT_TRUE(Covers(*c.summary.image_distance_mm, s.truth.image_distance_mm));
  EXPECT_TRUE(Covers(*c.summary.blur_ratio, s.truth.blur_ratio))
      << c.summary.blur_ratio->value << " for " << s.truth.blur_ratio;
}

model::StageOptions Backlash(double backlash_mm) {
  model::StageOptions stage;
  stage.there_and_back = true;
  stage.backlash_mm = backlash_mm;
  return stage;
}

TEST(StageErrorsOfSweeps, AGoodSweepThereAndBackNamesNone) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const SimulatedSweep s = Bench(Backlash(0), seed);
    const Calibration c = CalibrateWithoutMap(s);
    EXPECT_TRUE(c.diagnostics.stage.compared) << c.diagnostics.stage.message;
    EXPECT_EQ(c.diagnostics.stage.InWords(), "");
    EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("bend against the image scale"))));
    ExpectCovered(c, s);
  }
}

TEST(StageErrorsOfSweeps, BacklashIsCorrectedAndNamed) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    for (const bool knows_zero : {false, true}) {
      const SimulatedSweep s = Bench(Backlash(0.5), seed, knows_zero);
      const Calibration c = CalibrateWithoutMap(s);
      const StageErrors& stage = c.diagnostics.stage;
      ASSERT_TRUE(stage.backlash_mm) << stage.message << c.summary.reason;
      EXPECT_NEAR(stage.backlash_mm->value, 0.5, 4 * stage.backlash_mm->sigma);
      EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("backlash")));
      EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("jump"))));
      ExpectCovered(c, s);
      const FrameMeasurement& last = c.frames.back();
      EXPECT_EQ(last.reading_mm, s.sweep.frames.back().reading_mm);
      EXPECT_NEAR(last.stage_error_mm, stage.backlash_mm->value, 1e-9);
    }
  }
}

TEST(StageErrorsOfSweeps, AScrewsErrorIsCorrectedAndNamed) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    model::StageOptions stage;
    stage.screw_error_mm = 0.4;
    stage.screw_period_mm = 5;
    const SimulatedSweep s = Bench(stage, seed);
    const Calibration c = CalibrateWithoutMap(s);
    ASSERT_TRUE(c.diagnostics.stage.periodic) << c.diagnostics.stage.message;
    const PeriodicError& error = *c.diagnostics.stage.periodic;
    EXPECT_NEAR(error.period_mm.value, 5, 4 * error.period_mm.sigma + 0.01);
    EXPECT_NEAR(error.amplitude_mm.value, 0.4, 4 * error.amplitude_mm.sigma);
    EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("lead screw")));
    ExpectCovered(c, s);
  }
}

TEST(StageErrorsOfSweeps, LostStepsOnTheWayAreNoBacklash) {
  model::StageOptions stage = Backlash(0);
  stage.slip_mm = 0.6;
  stage.slip_from_frame = 30;
  const SimulatedSweep s = Bench(stage, 2);
  const Calibration c = CalibrateWithoutMap(s);
  ASSERT_TRUE(c.diagnostics.stage.slip_mm) << c.diagnostics.stage.message;
  EXPECT_FALSE(c.diagnostics.stage.backlash_mm);
  EXPECT_EQ(c.diagnostics.stage.slip_from_frame, 30);
  ExpectCovered(c, s);
}

TEST(StageErrorsOfSweeps, TheBlurShowsWhatTheScaleOfAMacroSweepDoesNot) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    const SimulatedSweep s = Macro(Backlash(0.04), seed);
    const Calibration c = CalibrateWithoutMap(s);
    ASSERT_TRUE(c.diagnostics.stage.backlash_mm) << c.diagnostics.stage.message << c.summary.reason;
    EXPECT_NEAR(c.diagnostics.stage.backlash_mm->value, 0.04,
                4 * c.diagnostics.stage.backlash_mm->sigma);
    ExpectCovered(c, s);
    ASSERT_TRUE(c.diagnostics.focus_reading_mm);
    EXPECT_NEAR(c.diagnostics.focus_reading_mm->value, 16.25,
                5 * c.diagnostics.focus_reading_mm->sigma);
  }
}

TEST(StageErrorsOfSweeps, CoarseReadingsAreScatterAndNoErrorOfTheStage) {
  for (const double resolution_mm : {0.1, 1.0}) {
    model::StageOptions stage;
    stage.resolution_mm = resolution_mm;
    const SimulatedSweep s = Bench(stage, 2);
    const Calibration c = CalibrateWithoutMap(s);
    EXPECT_FALSE(c.diagnostics.stage.Corrected()) << c.diagnostics.stage.InWords();
    EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("bend against the image scale"))));
    ExpectCovered(c, s);
  }
}

TEST(StageErrorsOfSweeps, ASwappedPairOfAMacroSweepIsNamedByItsBlur) {
  model::StageOptions stage;
  stage.there_and_back = true;
  SimulatedSweep s = Macro(stage, 3);
  std::swap(s.sweep.frames[2].reading_mm, s.sweep.frames[17].reading_mm);
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_THAT(c.frames[2].rejection, HasSubstr("swapped with frame-17"));
  EXPECT_THAT(c.frames[17].rejection, HasSubstr("swapped with frame-2"));
  ExpectCovered(c, s);
}

}  // namespace
}  // namespace thicklens::calib
