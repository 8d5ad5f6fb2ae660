// Sweeps that fail for a simple reason. The message must state that reason, not its consequences.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "tests/calib/calibrated_sweep.h"
#include "tests/calib/damaged_sweep.h"
#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using thicklens::testing::CalibrateWithoutMap;
using thicklens::testing::DeepCopy;
using thicklens::testing::Simulate;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;
using thicklens::testing::SweepWithFloor;

constexpr int kSizePx = 160;

SimulatedSweep Good() {
  static const SimulatedSweep rendered = SweepWithFloor("iii", kSizePx, 1);
  return DeepCopy(rendered);
}

SimulatedSweep KnifeEdge() {
  model::SweepSimulationOptions options = SweepCase("iii", kSizePx, 1);
  options.target.kind = model::TargetKind::kKnifeEdge;
  SimulatedSweep sweep = Simulate(options);
  sweep.sweep.target = model::SweepTarget::kKnifeEdge;
  return sweep;
}

// Changes the exposure of all frames except those from `first` to `last`.
void Expose(SimulatedSweep* s, double gain, int first, int last) {
  for (int i = 0; i < static_cast<int>(s->stored->size()); ++i) {
    if (i < first || i > last) s->frame(i).convertTo(s->frame(i), CV_8U, gain);
  }
}

TEST(Exposure, AnOverExposedSweepGetsTheAdviceToLowerIt) {
  for (const bool zero_is_known : {true, false}) {
    for (const int last : {-1, 2, 6}) {  // none, three or seven good frames, away from focus
      SCOPED_TRACE(last);
      SimulatedSweep s = Good();
      if (!zero_is_known) s.sweep.offset_mm.reset();
      Expose(&s, 6, 0, last);
      const Calibration c = CalibrateWithoutMap(s);
      const std::string reported =
          c.summary.outcome == Outcome::kRefused || c.summary.warnings.empty()
              ? c.summary.reason
              : c.summary.warnings.front();
      EXPECT_THAT(reported, AllOf(HasSubstr("of 41 frames are over-exposed: lower the exposure"),
                                  Not(StartsWith("offset_mm"))));
    }
  }
}

// Thirteen frames about focus are enough for a result, but the message says that they are few.
TEST(Exposure, AResultFromTheFewGoodFramesSaysSo) {
  SimulatedSweep s = Good();
  Expose(&s, 6, 14, 26);
  const Calibration c = CalibrateWithoutMap(s);
  ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  ASSERT_FALSE(c.summary.warnings.empty());
  EXPECT_THAT(c.summary.warnings.front(),
              AllOf(HasSubstr("of 41 frames are over-exposed: lower the exposure"),
                    HasSubstr("the results come from the other frames alone")));
}

TEST(Exposure, ADarkSweepGetsTheAdviceToRaiseIt) {
  SimulatedSweep s = Good();
  Expose(&s, 0.01, 0, 1);
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason,
              StartsWith("39 of 41 frames are under-exposed: raise the exposure"));
}

TEST(Exposure, AFewBadFramesAreNotTheCause) {
  SimulatedSweep s = Good();
  Expose(&s, 6, 4, 40);
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("exposed"))));
}

// Half of the sweep is missing because of the light, so no other advice is given.
TEST(Exposure, WhatFollowsFromItIsNotAdvisedOn) {
  SimulatedSweep s = Good();
  Expose(&s, 6, 0, 6);
  const Calibration c = CalibrateWithoutMap(s);
  ASSERT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason, AllOf(StartsWith("34 of 41 frames are over-exposed"),
                                      EndsWith("take the sweep again")));
}

TEST(Unit, ReadingsInInchesAreAskedAbout) {
  SimulatedSweep s = Good();
  s.sweep.offset_mm.reset();
  for (model::SweepFrame& frame : s.sweep.frames) frame.reading_mm /= 25.4;
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason, AllOf(StartsWith("the image scale puts the target at "),
                                      HasSubstr("that the readings are in mm")));
}

TEST(Region, TooSmallForAnythingIsRefusedBeforeItIsMeasured) {
  SimulatedSweep s = Good();
  s.sweep.roi = {60, 60, 80, 23};
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason, StartsWith("the region of interest (roi_px) has 80 x 23 px"));
  EXPECT_EQ(c.frames[0].statistics.mean_encoded, 0);
}

TEST(Region, TooSmallForATextureIsNamedAsTheCause) {
  SimulatedSweep s = Good();
  s.sweep.roi = {60, 60, 40, 40};
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason,
              StartsWith("the region of interest (roi_px) has 40 x 40 px: an edge requires"));
}

TEST(Region, ASmallOneThatIsEnoughIsLeftAlone) {
  SimulatedSweep s = KnifeEdge();
  s.sweep.roi = {60, 60, 40, 40};
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_EQ(c.summary.outcome, Outcome::kOk) << c.summary.reason;
  EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("roi_px"))));
}

}  // namespace
}  // namespace thicklens::calib
