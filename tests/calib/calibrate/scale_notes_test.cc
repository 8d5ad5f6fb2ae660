// Messages of a calibration about the image scale, for a lone edge, which has none, and for
// nonlinear readings.
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
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::CalibrateWithoutMap;
using thicklens::testing::DeepCopy;
using thicklens::testing::Simulate;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;
using thicklens::testing::SweepWithFloor;
using thicklens::testing::Thinned;

constexpr int kSizePx = 160;

SimulatedSweep Good() {
  static const SimulatedSweep rendered = SweepWithFloor("iii", kSizePx, 1);
  return DeepCopy(rendered);
}

SimulatedSweep KnifeEdge() {
  model::SweepSimulationOptions options = SweepCase("iii", kSizePx, 1);
  options.target.kind = model::TargetKind::kKnifeEdge;
  static const SimulatedSweep rendered = Thinned(Simulate(options), 2);
  SimulatedSweep sweep = rendered;
  sweep.sweep.target = model::SweepTarget::kKnifeEdge;
  return sweep;
}

TEST(LoneEdge, ItsMissingScaleIsANoteNotAWarning) {
  const SimulatedSweep s = KnifeEdge();
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_EQ(c.summary.outcome, Outcome::kOk) << c.summary.reason;
  EXPECT_FALSE(c.diagnostics.scale.done);
  EXPECT_EQ(c.diagnostics.scale.message,
            "a lone edge shows no image scale: the given offset_mm is used unchecked");
  EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("offset_mm"))));
}

TEST(LoneEdge, NeedsAGivenOffset) {
  SimulatedSweep s = KnifeEdge();
  s.sweep.offset_mm.reset();
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason,
              AllOf(HasSubstr("a lone edge shows no image scale;"), HasSubstr("state offset_mm")));
}

// If the target is not stated to be a lone edge, it may be a printed edge with a softness of its
// own.
TEST(LoneEdge, OfAnUnstatedTargetItsSoftnessIsOpen) {
  SimulatedSweep s = KnifeEdge();
  s.sweep.target = model::SweepTarget::kAuto;
  const Calibration c = CalibrateWithoutMap(s);
  ASSERT_EQ(c.summary.outcome, Outcome::kPartial) << c.summary.reason;
  const double reach_mm = 2 * c.summary.focus_depth_mm->sigma;
  EXPECT_LT(c.summary.focus_depth_mm->systematic->x() - reach_mm, s.truth.focus_depth_mm);
  EXPECT_GT(c.summary.focus_depth_mm->systematic->y() + reach_mm, s.truth.focus_depth_mm);
  EXPECT_THAT(c.diagnostics.scale.message, HasSubstr("the given offset_mm is used unchecked"));
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("one straight edge and nothing else")));
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("photograph a knife edge")));
}

class StraightModel : public ::testing::TestWithParam<const char*> {};

TEST_P(StraightModel, SlowAStraightLawHasNoNoteOfABend) {
  for (const std::uint64_t seed : {1U, 2U}) {
    SimulatedSweep s = SweepWithFloor(GetParam(), 256, seed);
    const Calibration c = CalibrateWithoutMap(s);
    EXPECT_TRUE(c.diagnostics.scale.done) << c.diagnostics.scale.message;
    EXPECT_THAT(c.summary.warnings, Not(Contains(HasSubstr("bend")))) << seed;
  }
}
INSTANTIATE_TEST_SUITE_P(Cases, StraightModel, ::testing::Values("i", "ii", "iii", "iv", "v"));

// The readings are from a rail with an uneven screw: +0.8 mm at both ends relative to the middle.
TEST(BentModel, IsWarnedOfWithItsSize) {
  SimulatedSweep s = Good();
  for (model::SweepFrame& frame : s.sweep.frames) {
    const double u = (frame.reading_mm - 400) / 80;
    frame.reading_mm += 0.8 * u * u;
  }
  const Calibration c = CalibrateWithoutMap(s);
  const auto warning = std::find_if(
      c.summary.warnings.begin(), c.summary.warnings.end(), [](const std::string& text) {
        return text.find("readings bend against the image scale") != std::string::npos;
      });
  ASSERT_NE(warning, c.summary.warnings.end());
  EXPECT_THAT(*warning, AllOf(HasSubstr("they deviate by -0."), HasSubstr("less certain")));
  const std::string before = "they deviate by ";
  EXPECT_NEAR(std::stod(warning->substr(warning->find(before) + before.size())), -0.8, 0.2);
}

}  // namespace
}  // namespace thicklens::calib
