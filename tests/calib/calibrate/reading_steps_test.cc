// Readings that are wrong together, and a wrong reading of the frame to which all others refer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "calib/registration/reading_checks.h"
#include "tests/calib/calibrated_sweep.h"
#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::CalibrateWithoutMap;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepWithFloor;

SimulatedSweep Sweep() { return SweepWithFloor("iii", 256, 5); }

TEST(ReadingSteps, AJumpIsNamedAndWidensTheInterval) {
  constexpr double kJumpMm = 1.5;
  constexpr std::size_t kFirst = 21;
  SimulatedSweep s = Sweep();
  for (std::size_t i = kFirst; i < s.sweep.frames.size(); ++i)
    s.sweep.frames[i].reading_mm += kJumpMm;
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("the readings jump by +1.")));
  ASSERT_TRUE(c.summary.focus_depth_mm && c.summary.focus_depth_mm->systematic) << c.summary.reason;
  const double truth = s.truth.focus_depth_mm;
  EXPECT_LT(c.summary.focus_depth_mm->systematic->x(), truth);
  EXPECT_GT(c.summary.focus_depth_mm->systematic->y(), truth);
  const auto part =
      std::find_if(c.diagnostics.systematic_parts.begin(), c.diagnostics.systematic_parts.end(),
                   [](const SystematicPart& p) { return p.name == "jump of the readings"; });
  ASSERT_NE(part, c.diagnostics.systematic_parts.end());
  // Moving the frames before the jump moves zf by a part of the jump only, because most frames are
  // not affected.
  EXPECT_GT(part->focus_depth_mm.y(), 0.2 * kJumpMm);
  EXPECT_LT(part->focus_depth_mm.y(), 1.2 * kJumpMm);
}

TEST(ReadingSteps, AGoodSweepHasNoJump) {
  const Calibration c = CalibrateWithoutMap(Sweep());
  EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("jump"))));
}

// Otherwise the frames would refer to the most blurred frame, or to no depth at all.
TEST(WrongReference, TheNextSharpestTakesItsPlace) {
  SimulatedSweep s = Sweep();
  const Calibration clean = CalibrateWithoutMap(s);
  ASSERT_TRUE(clean.summary.focus_depth_mm && clean.summary.blur_ratio) << clean.summary.reason;
  const int sharpest = clean.diagnostics.paper_recipe.sharpest_normalised_frame;
  s.sweep.frames[static_cast<std::size_t>(sharpest)].reading_mm += 30;
  const Calibration c = CalibrateWithoutMap(s);
  ASSERT_TRUE(c.summary.focus_depth_mm && c.summary.blur_ratio) << c.summary.reason;
  EXPECT_THAT(c.frames[static_cast<std::size_t>(sharpest)].rejection,
              HasSubstr("reading off by 30"));
  EXPECT_EQ(std::count_if(c.frames.begin(), c.frames.end(),
                          [](const FrameMeasurement& f) { return !f.rejection.empty(); }),
            1);
  EXPECT_NEAR(c.summary.focus_depth_mm->value, clean.summary.focus_depth_mm->value,
              2 * clean.summary.focus_depth_mm->sigma);
  EXPECT_NEAR(c.summary.blur_ratio->value, clean.summary.blur_ratio->value,
              2 * clean.summary.blur_ratio->sigma);
}

TEST(ShuffledReadings, AreRefusedAlsoWithAGivenOffset) {
  SimulatedSweep s = Sweep();
  for (std::size_t i = 0; i < s.sweep.frames.size(); ++i) {
    const std::size_t from = (i * 17) % s.sweep.frames.size();
    s.sweep.frames[i].reading_mm = s.truth.frames[from].reading_mm;
  }
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason, HasSubstr("does not follow the readings"));
}

}  // namespace
}  // namespace thicklens::calib
