// Sweeps at magnifications from 1 to 20, which are short against the depth of their target: their
// image scale determines the bench offset poorly or not at all.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <string>

#include "support/test_cameras.h"
#include "tests/calib/calibrated_sweep.h"
#include "thicklens/model/objective.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using testing::CalibrateWithoutMap;
using ::testing::Contains;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::Simulate;
using testing::SimulatedSweep;
using ::testing::StartsWith;
using testing::SweepCase;

struct MacroCase {
  model::ThickLens lens;
  double pitch_mm, focus_mm, step_mm, reading_sigma_mm, offset_mm;
};

// A macro lens at 1:1 and a microscope lens at 4:1, with 31 frames each.
const MacroCase kOneToOne = {{100, 100, 0, 17.86}, 0.0043, 200, 0.1, 0.002, 100};
const MacroCase kFourToOne = {{45, 45, 0, 4.6}, 0.00345, 56.25, 0.03, 0.001, 40};

// Objectives 10/0.25 and 20/0.4 with a tube lens of 200 mm. In 60 and 30 um of sweep the image
// scale changes by 0.3 %.
const model::Objective kTen = {10, 0.25, 200}, kTwenty = {20, 0.4, 200};
MacroCase TenToOne() { return {model::LensOfObjective(kTen), 0.0065, 22, 0.002, 0.0002, 5}; }
MacroCase TwentyToOne() { return {model::LensOfObjective(kTwenty), 0.0065, 10.5, 0.001, 1e-4, 5}; }

SimulatedSweep MacroSweep(const MacroCase& macro, std::uint64_t seed = 1,
                          std::optional<model::TargetKind> target = std::nullopt) {
  model::SweepSimulationOptions options = SweepCase("ii", 384, seed);
  options.camera.lens = macro.lens;
  options.camera.sensor.pixel_pitch_mm = macro.pitch_mm;
  options.camera.calibration->image_distance_mm =
      model::Estimate{model::ImageDistanceMm(macro.lens, macro.focus_mm), 0};
  if (target) options.target.kind = *target;
  options.frame_count = 31;
  options.first_depth_mm = macro.focus_mm - 14.7 * macro.step_mm;
  options.step_mm = macro.step_mm;
  options.bench_offset_mm = macro.offset_mm;
  options.reading_sigma_mm = macro.reading_sigma_mm;
  options.bits = 16;
  SimulatedSweep sweep = Simulate(options);
  sweep.sweep.offset_mm.reset();
  testing::GiveFloor(&sweep);
  return sweep;
}

void ExpectFocusReading(const Calibration& c, const SimulatedSweep& sweep, double most_sigma_mm) {
  ASSERT_TRUE(c.diagnostics.focus_reading_mm) << c.summary.reason;
  const model::Estimate& reading = *c.diagnostics.focus_reading_mm;
  EXPECT_LT(reading.sigma, most_sigma_mm);
  EXPECT_NEAR(reading.value, sweep.truth.focus_depth_mm - sweep.truth.bench_offset_mm,
              4 * reading.sigma);
}

// The growth of the blur per reading, from the lens equation by finite differences.
double TrueSlope(const SimulatedSweep& sweep) {
  const model::Camera& camera = sweep.sweep.camera;
  const double d1_mm = sweep.truth.image_distance_mm, zf = sweep.truth.focus_depth_mm;
  const double step_mm = 1e-4 * zf;
  const double across = model::BlurRadiusMm(camera.lens, d1_mm, zf + step_mm) +
                        model::BlurRadiusMm(camera.lens, d1_mm, zf - step_mm);
  return sweep.truth.blur_ratio * across / (2 * step_mm) / camera.sensor.pixel_pitch_mm;
}

TEST(MacroSweep, WithoutABenchOffsetGivesDepthsWithItsError) {
  for (const MacroCase& macro : {kOneToOne, kFourToOne}) {
    const SimulatedSweep sweep = MacroSweep(macro);
    const Calibration c = CalibrateWithoutMap(sweep);
    ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
    ExpectFocusReading(c, sweep, 0.02 * macro.step_mm);
    const Result& zf = *c.summary.focus_depth_mm;
    EXPECT_NEAR(zf.value, macro.focus_mm, 3 * zf.sigma);
    EXPECT_GT(zf.sigma, 0.5 * macro.step_mm) << "the image scale does not determine it so well";
    EXPECT_LT(zf.sigma, 0.03 * macro.focus_mm);
    const Result& ratio = *c.summary.blur_ratio;
    EXPECT_NEAR(ratio.value, 0.45, 3 * ratio.sigma);
    EXPECT_LT(ratio.sigma, 0.06);
    EXPECT_EQ(c.diagnostics.bench_offset_from, "the image scale");
    const model::Estimate& m = *c.diagnostics.magnification_at_focus;
    EXPECT_NEAR(
        m.value,
        macro.lens.front_focal_length_mm / (macro.focus_mm - macro.lens.front_focal_length_mm),
        3 * m.sigma);
    const model::Estimate& slope = *c.diagnostics.blur_slope_px_per_mm;
    EXPECT_NEAR(slope.value, TrueSlope(sweep), 4 * slope.sigma);
    EXPECT_LT(slope.sigma, 0.01 * slope.value) << "it does not need the bench offset";
    EXPECT_THAT(c.diagnostics.advice, HasSubstr("state the magnification"));
    EXPECT_THAT(c.summary.warnings, Each(Not(HasSubstr("focal lengths"))));
  }
}

// A statement of any kind takes the place of the image scale, and its error that of the offset.
TEST(MacroSweep, AnythingThatIsKnownOfThePlaneOfFocusServes) {
  struct Statement {
    model::ConjugateKind kind;
    double value, sigma;
  };
  const Statement statements[] = {{model::ConjugateKind::kMagnification, 1, 0.001},
                                  {model::ConjugateKind::kImageDistance, 200, 0.1},
                                  {model::ConjugateKind::kTubeLength, 100, 0.1},
                                  {model::ConjugateKind::kFocusDepth, 200, 0.1}};
  const SimulatedSweep simulated = MacroSweep(kOneToOne);
  for (const Statement& stated : statements) {
    SimulatedSweep sweep = simulated;
    sweep.sweep.stated_focus = {{stated.kind, {stated.value, stated.sigma}, "what is stated"}};
    const Calibration c = CalibrateWithoutMap(sweep);
    ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
    EXPECT_EQ(c.diagnostics.bench_offset_from, "what is stated");
    const Result& zf = *c.summary.focus_depth_mm;
    EXPECT_NEAR(zf.value, 200, 1e-3);
    EXPECT_NEAR(zf.sigma, 0.1, 0.001);
    EXPECT_NEAR(c.summary.bench_offset_mm->value, 100, 0.01);
    EXPECT_NEAR(c.summary.blur_ratio->value, 0.45, 4 * c.summary.blur_ratio->sigma);
    EXPECT_LT(c.summary.blur_ratio->sigma, 0.003);
    ExpectFocusReading(c, sweep, 0.002);
    for (const FrameMeasurement& frame : c.frames)
      EXPECT_NEAR(frame.depth_mm, c.summary.bench_offset_mm->value + frame.reading_mm, 1e-9);
    // A distance of the object needs no focal length; the others are in proportion to it.
    const bool needs_f = stated.kind != model::ConjugateKind::kFocusDepth;
    const double half_mm = 0.5 * (zf.systematic->y() - zf.systematic->x());
    EXPECT_EQ(half_mm > 1, needs_f) << half_mm;
  }
}

// The scale of a long sweep is better than a statement with a large error, which then only has to
// agree with it.
TEST(MacroSweep, TheMorePreciseOfScaleAndStatementIsUsed) {
  SimulatedSweep sweep = MacroSweep(kOneToOne);
  sweep.sweep.stated_focus = {{model::ConjugateKind::kFocusDepth, {205, 8}, "focus_depth_mm"}};
  Calibration c = CalibrateWithoutMap(sweep);
  EXPECT_EQ(c.diagnostics.bench_offset_from, "the image scale");
  EXPECT_THAT(c.summary.warnings, Each(Not(HasSubstr("focus_depth_mm puts"))));
  // A statement that contradicts a given offset gives a warning and widens the interval.
  sweep.sweep.offset_mm = model::Estimate{100, 0.1};
  sweep.sweep.stated_focus = {{model::ConjugateKind::kFocusDepth, {205, 0.5}, "focus_depth_mm"}};
  c = CalibrateWithoutMap(sweep);
  EXPECT_EQ(c.diagnostics.bench_offset_from, "offset_mm");
  EXPECT_NEAR(c.summary.focus_depth_mm->value, 200, 0.1);
  EXPECT_THAT(c.summary.warnings,
              Contains(AllOf(StartsWith("focus_depth_mm puts the in-focus object distance at 205"),
                             HasSubstr("+5 mm from that by offset_mm"))));
  EXPECT_GT(c.summary.focus_depth_mm->systematic->y(), 204.9);
  EXPECT_GT(c.summary.focus_depth_mm->systematic->x(), 199) << "nothing lies on the other side";
  EXPECT_GT(c.summary.bench_offset_mm->systematic->y(), 104.9);
  // kappa is in proportion to zf (zf - f1). The interval reaches to 205 mm and two sigma more.
  EXPECT_NEAR(c.summary.blur_ratio->systematic->y(), 0.45 * 206 * 106 / (200 * 100), 0.005);
}

// The image scale puts the target at 200 mm, and a magnification of 0.85 at 218 mm.
TEST(MacroSweep, AStatementThatTheImageScaleContradictsGivesAWarning) {
  SimulatedSweep sweep = MacroSweep(kOneToOne);
  sweep.sweep.stated_focus = {{model::ConjugateKind::kMagnification, {0.85, 0}, "magnification"}};
  Calibration c = CalibrateWithoutMap(sweep);
  ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  EXPECT_NEAR(c.summary.focus_depth_mm->value, 100 + 100 / 0.85, 1e-3);
  EXPECT_THAT(c.summary.warnings,
              Contains(AllOf(StartsWith("the image scale puts the in-focus object distance at"),
                             HasSubstr("from that by magnification (217.65"),
                             HasSubstr("entrance pupil"))));
  EXPECT_LT(c.summary.focus_depth_mm->systematic->x(), 204) << "the interval includes both";
  // A magnification that is off by a factor of two makes the blur impossible.
  sweep.sweep.stated_focus[0].value.value = 0.5;
  c = CalibrateWithoutMap(sweep);
  ASSERT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason,
              AllOf(StartsWith("the image scale puts the in-focus object distance at"),
                    HasSubstr("from that by magnification (300 "),
                    HasSubstr("; the immediate reason is: the blur ratio would have to be"),
                    HasSubstr("which no lens has")));
  ExpectFocusReading(c, sweep, 0.002);
  // So does another statement that it contradicts.
  sweep.sweep.camera.statements["lens.front_focal_length_mm"].tolerance = 1e-3;
  sweep.sweep.stated_focus[0].value.value = 5;
  sweep.sweep.stated_focus.push_back(
      {model::ConjugateKind::kFocusDepth, {200, 0.1}, "focus_depth_mm"});
  c = CalibrateWithoutMap(sweep);
  ASSERT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason,
              StartsWith("focus_depth_mm puts the in-focus object distance at 200 "));
}

// A rough bench offset beside a more precise statement only has to agree with it.
TEST(MacroSweep, ARoughOffsetOnlyHasToAgree) {
  SimulatedSweep sweep = MacroSweep(kOneToOne);
  sweep.sweep.offset_mm = model::Estimate{112, 15};
  sweep.sweep.stated_focus = {{model::ConjugateKind::kMagnification, {1, 0.001}, "magnification"}};
  Calibration c = CalibrateWithoutMap(sweep);
  ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  EXPECT_EQ(c.diagnostics.bench_offset_from, "magnification");
  EXPECT_NEAR(c.summary.focus_depth_mm->value, 200, 1e-3);
  EXPECT_THAT(c.summary.warnings, Each(Not(HasSubstr("offset_mm puts"))));
  // Whatever was compared is listed: the image scale, too.
  ASSERT_EQ(c.diagnostics.compared_focus.size(), 2U);
  for (const ComparedFocus& other : c.diagnostics.compared_focus) EXPECT_TRUE(other.agrees);
  EXPECT_EQ(c.diagnostics.compared_focus[1].name, "offset_mm");
  EXPECT_NEAR(c.diagnostics.compared_focus[1].focus_depth_mm.value, 212, 0.1);
  EXPECT_EQ(c.diagnostics.compared_focus[1].focus_depth_mm.sigma, 15);
  sweep.sweep.offset_mm = model::Estimate{180, 15};
  c = CalibrateWithoutMap(sweep);
  EXPECT_EQ(c.diagnostics.bench_offset_from, "magnification");
  EXPECT_THAT(c.summary.warnings,
              Contains(StartsWith("offset_mm puts the in-focus object distance")));
  ASSERT_EQ(c.diagnostics.compared_focus.size(), 2U);
  EXPECT_TRUE(c.diagnostics.compared_focus[0].agrees);
  EXPECT_FALSE(c.diagnostics.compared_focus[1].agrees);
  // The image scale takes its place only if it is much more precise.
  sweep.sweep.stated_focus.clear();
  sweep.sweep.offset_mm = model::Estimate{112, 15};
  c = CalibrateWithoutMap(sweep);
  EXPECT_EQ(c.diagnostics.bench_offset_from, "the image scale");
  sweep.sweep.offset_mm = model::Estimate{100, 2};
  c = CalibrateWithoutMap(sweep);
  EXPECT_EQ(c.diagnostics.bench_offset_from, "offset_mm");
}

// Where a magnification gives zf, both focal lengths of a lens in air are one, and the offset moves
// with zf.
TEST(MacroSweep, OneFocalLengthCountsOnce) {
  SimulatedSweep sweep = MacroSweep(kOneToOne);
  sweep.sweep.stated_focus = {{model::ConjugateKind::kMagnification, {1, 0}, "magnification"}};
  const auto half_mm = [](const std::optional<Result>& result) {
    EXPECT_TRUE(result && result->systematic);
    return 0.5 * (result->systematic->y() - result->systematic->x());
  };
  sweep.sweep.camera.statements["lens.front_focal_length_mm"].tolerance = 0.5;
  const Calibration front = CalibrateWithoutMap(sweep);
  EXPECT_NEAR(half_mm(front.summary.focus_depth_mm), 1, 0.02);  // zf = 2 f
  EXPECT_NEAR(half_mm(front.summary.bench_offset_mm), 1, 0.02);
  EXPECT_NEAR(front.summary.bench_offset_mm->systematic->mean(), 100, 0.1);
  sweep.sweep.camera.statements["lens.rear_focal_length_mm"].tolerance = 0.5;
  const Calibration both = CalibrateWithoutMap(sweep);
  EXPECT_NEAR(half_mm(both.summary.focus_depth_mm), 1, 0.02);
  EXPECT_NEAR(half_mm(both.summary.image_distance_mm), half_mm(front.summary.image_distance_mm),
              1e-6);
  sweep.sweep.camera.statements.erase("lens.front_focal_length_mm");
  const Calibration rear = CalibrateWithoutMap(sweep);
  EXPECT_NEAR(half_mm(rear.summary.focus_depth_mm), 1, 0.02) << "not the 1 % of labels";
}

TEST(MacroSweep, AWrongMagnificationOfAnObjectiveIsNamed) {
  for (const double stated : {1.0, 100.0}) {
    SimulatedSweep sweep = MacroSweep(TenToOne());
    sweep.sweep.camera.objective = model::Objective{stated, 0.25, 200};
    sweep.sweep.camera.lens = model::LensOfObjective(*sweep.sweep.camera.objective);
    sweep.sweep.stated_focus = {
        {model::ConjugateKind::kMagnification, {stated, 0.03 * stated}, "lens.magnification"}};
    const Calibration c = CalibrateWithoutMap(sweep);
    ASSERT_EQ(c.summary.outcome, Outcome::kRefused);
    EXPECT_THAT(c.summary.reason, AllOf(HasSubstr("lens.magnification"), HasSubstr("the blur fits"),
                                        HasSubstr("lens.tube_lens_focal_length_mm")));
    EXPECT_THAT(c.summary.reason, Not(StartsWith("the image scale follows the lens")));
  }
}

TEST(MacroSweep, WhereNothingDeterminesTheDistanceTheReadingAtFocusIsStillFound) {
  const SimulatedSweep sweep = MacroSweep(TwentyToOne());
  const Calibration c = CalibrateWithoutMap(sweep);
  ASSERT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason, AllOf(StartsWith("nothing determines the distance of the target"),
                                      HasSubstr("The reading at focus is known (5.50"),
                                      HasSubstr("State one of: target_period_mm")));
  ExpectFocusReading(c, sweep, 0.0005);
  const model::Estimate& slope = *c.diagnostics.blur_slope_px_per_mm;
  EXPECT_NEAR(slope.value, TrueSlope(sweep), 4 * slope.sigma + 0.005 * slope.value);
  EXPECT_FALSE(c.summary.focus_depth_mm);
  EXPECT_FALSE(c.summary.blur_ratio);
  EXPECT_FALSE(c.summary.bench_offset_mm);
  EXPECT_FALSE(c.diagnostics.paper_recipe.done);
  EXPECT_FALSE(c.diagnostics.sharpness.done);
  EXPECT_EQ(c.frames.front().depth_mm, 0);
}

// kappa is the slope over M tan(asin NA), so that 1 % of M is 1 % of kappa.
TEST(MacroSweep, AnObjectiveGivesTheBlurRatio) {
  for (const bool is_ten : {true, false}) {
    SimulatedSweep sweep = MacroSweep(is_ten ? TenToOne() : TwentyToOne());
    const model::Objective& objective = is_ten ? kTen : kTwenty;
    const double m = objective.magnification;
    sweep.sweep.camera.objective = objective;
    sweep.sweep.stated_focus = {
        {model::ConjugateKind::kMagnification, {m, 0.01 * m}, "lens.magnification"}};
    const Calibration c = CalibrateWithoutMap(sweep);
    ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
    EXPECT_EQ(c.diagnostics.bench_offset_from, "lens.magnification");
    EXPECT_NEAR(c.diagnostics.magnification_at_focus->value, m, 1e-6 * m);
    EXPECT_NEAR(c.diagnostics.magnification_at_focus->sigma, 0.01 * m, 1e-4 * m);
    EXPECT_NEAR(c.summary.blur_ratio->value, 0.45, 0.002);
    EXPECT_NEAR(c.summary.blur_ratio->sigma, 0.0045, 0.0008);
    // The tolerance of the standard, 5 %, is an interval of kappa.
    const Eigen::Vector2d& interval = *c.summary.blur_ratio->systematic;
    EXPECT_NEAR(0.5 * (interval.y() - interval.x()), 0.05 * 0.45, 0.003);
    ExpectFocusReading(c, sweep, 0.0005);
  }
}

// All parts of a chequerboard lose the same contrast, so that it does not show whether light is
// conserved: no transfer is accused.
TEST(MacroSweep, AChequerboardAccusesNoTransfer) {
  for (const std::uint64_t seed : {1, 14}) {
    const Calibration c =
        CalibrateWithoutMap(MacroSweep(kOneToOne, seed, model::TargetKind::kCheckerboard));
    ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
    EXPECT_FALSE(c.diagnostics.response.light_exponent);
    EXPECT_THAT(c.summary.warnings, Each(Not(HasSubstr("contradict sensor.transfer"))));
  }
}

}  // namespace
}  // namespace thicklens::calib
