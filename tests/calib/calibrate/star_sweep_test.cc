// Whole calibrations with a star of spokes, which looks the same at every scale.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/calib/calibrated_sweep.h"
#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using thicklens::testing::CalibrateWithoutMap;
using thicklens::testing::GiveFloor;
using thicklens::testing::Simulate;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;

SimulatedSweep StarSweep(const std::string& name, std::uint64_t seed) {
  model::SweepSimulationOptions options = SweepCase(name, 160, seed);
  options.target.kind = model::TargetKind::kSiemensStar;
  SimulatedSweep simulated = Simulate(options);
  GiveFloor(&simulated);
  return simulated;
}

void ExpectRight(const Calibration& c, const model::SweepTruth& truth, double step_mm) {
  ASSERT_TRUE(c.summary.focus_depth_mm && c.summary.blur_ratio && c.summary.image_distance_mm)
      << c.summary.reason;
  EXPECT_NEAR(c.summary.focus_depth_mm->value, truth.focus_depth_mm,
              3 * c.summary.focus_depth_mm->sigma);
  EXPECT_NEAR(c.summary.focus_depth_mm->value, truth.focus_depth_mm, 0.07 * step_mm);
  EXPECT_NEAR(c.summary.image_distance_mm->value, truth.image_distance_mm,
              3 * c.summary.image_distance_mm->sigma);
  EXPECT_NEAR(c.summary.blur_ratio->value, truth.blur_ratio, 3 * c.summary.blur_ratio->sigma);
  EXPECT_NEAR(c.summary.blur_ratio->value / truth.blur_ratio, 1, 0.01);
}

TEST(StarSweep, CalibratesWithinItsErrors) {
  const SimulatedSweep iii = StarSweep("iii", 3);
  const Calibration c = CalibrateWithoutMap(iii);
  EXPECT_EQ(c.summary.outcome, Outcome::kOk) << c.summary.reason;
  ExpectRight(c, iii.truth, 4);
  EXPECT_EQ(c.diagnostics.blur.estimator, "relative spectrum");
  EXPECT_FALSE(c.diagnostics.scale.done);
  EXPECT_THAT(c.summary.warnings,
              Contains(HasSubstr("the given offset_mm could not be checked: the target "
                                 "looks the same at every scale")));
}

TEST(StarSweep, StrongDefocusCalibratesToo) {
  const SimulatedSweep ii = StarSweep("ii", 4);
  ExpectRight(CalibrateWithoutMap(ii), ii.truth, 1);
}

// No scale reveals the wrong reading, but the blur does.
TEST(StarSweep, AWrongReadingIsNamedByItsBlur) {
  for (const double error_mm : {12.0, -25.0}) {
    SimulatedSweep s = StarSweep("iii", 3);
    s.sweep.frames[9].reading_mm += error_mm;
    const Calibration c = CalibrateWithoutMap(s);
    ExpectRight(c, s.truth, 4);
    EXPECT_THAT(c.frames[9].rejection, HasSubstr("reading off by"));
    int rejected = 0;
    for (const FrameMeasurement& frame : c.frames) rejected += frame.rejection.empty() ? 0 : 1;
    EXPECT_EQ(rejected, 1);
  }
}

// All frames are compared with the sharpest one. If the reading of that frame is wrong, another
// frame replaces it.
TEST(StarSweep, TheSharpestFrameMayHaveTheWrongReading) {
  SimulatedSweep s = StarSweep("iii", 3);
  const Calibration clean = CalibrateWithoutMap(s);
  const auto sharpest = static_cast<std::size_t>(
      std::max_element(clean.frames.begin(), clean.frames.end(),
                       [](const FrameMeasurement& a, const FrameMeasurement& b) {
                         return a.normalised_edge_slope < b.normalised_edge_slope;
                       }) -
      clean.frames.begin());
  s.sweep.frames[sharpest].reading_mm += 40;
  const Calibration c = CalibrateWithoutMap(s);
  ExpectRight(c, s.truth, 4);
  EXPECT_THAT(c.frames[sharpest].rejection, HasSubstr("reading off by"));
  EXPECT_FALSE(c.frames[sharpest].in_blur_fit);
  // The comparison of bands and shapes was possible, although it needs a reference.
  EXPECT_EQ(clean.diagnostics.systematic_parts.size(), c.diagnostics.systematic_parts.size());
  EXPECT_TRUE(c.diagnostics.blur.disc_misfit);
}

TEST(StarSweep, WithoutAnOffsetItSaysWhatToDo) {
  SimulatedSweep s = StarSweep("iii", 3);
  s.sweep.offset_mm.reset();
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_FALSE(c.summary.focus_depth_mm);
  EXPECT_THAT(c.summary.reason, HasSubstr("offset_mm is not stated"));
  EXPECT_THAT(c.summary.reason, HasSubstr("looks the same at every scale"));
  EXPECT_THAT(c.summary.reason, HasSubstr("state offset_mm, or use a texture"));
}

}  // namespace
}  // namespace thicklens::calib
