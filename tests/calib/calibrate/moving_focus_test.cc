// Sweeps in which the lens or the sensor moves and the target stands still.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <string>

#include "support/test_cameras.h"
#include "tests/calib/calibrated_sweep.h"
#include "thicklens/base/error.h"

namespace thicklens::calib {
namespace {

using model::SweepMotion;
using ::testing::AllOf;
using testing::CalibrateWithoutMap;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::Simulate;
using testing::SimulatedSweep;
using testing::SweepCase;

// A lens of 50 mm at f/2.8 in front of a target at `focus_mm`; 25 frames, `step_mm` apart, about
// the focus.
SimulatedSweep MovingSweep(SweepMotion moves, double focus_mm, double step_mm,
                           std::uint64_t seed = 1,
                           model::BenchDirection direction = model::BenchDirection::kAway,
                           double tilt_deg = 0) {
  model::SweepSimulationOptions options = SweepCase("ii", 384, seed);
  options.camera.lens = {50, 50, 4, 8.9286};
  options.camera.sensor.pixel_pitch_mm = 0.0045;
  const double d1_mm = model::ImageDistanceMm(options.camera.lens, focus_mm);
  options.camera.calibration->image_distance_mm = model::Estimate{d1_mm, 0};
  options.frame_count = 25;
  options.moves = moves;
  options.first_image_distance_mm = d1_mm - 11.6 * step_mm;
  options.step_mm = step_mm;
  options.bench_offset_mm = d1_mm - 3;
  options.direction = direction;
  options.target.tilt_deg = tilt_deg;
  options.reading_sigma_mm = 0.02 * step_mm;
  options.lamp_falloff = false;
  options.bits = 16;
  SimulatedSweep sweep = Simulate(options);
  sweep.sweep.offset_mm.reset();
  sweep.sweep.moves = moves;
  testing::GiveFloor(&sweep);
  return sweep;
}

void ExpectTrue(const Calibration& c, const SimulatedSweep& sweep) {
  ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  const Result& d1 = *c.summary.image_distance_mm;
  EXPECT_NEAR(d1.value, sweep.truth.image_distance_mm, 4 * d1.sigma + 1e-4);
  const Result& zf = *c.summary.focus_depth_mm;
  EXPECT_NEAR(zf.value, sweep.truth.focus_depth_mm, 4 * zf.sigma + 1e-3);
  const Result& ratio = *c.summary.blur_ratio;
  EXPECT_NEAR(ratio.value, sweep.truth.blur_ratio, 4 * ratio.sigma + 0.002);
  const model::Estimate& reading = *c.diagnostics.focus_reading_mm;
  const double sign = model::DirectionSign(sweep.sweep.direction);
  EXPECT_NEAR(reading.value, sign * (sweep.truth.image_distance_mm - sweep.truth.bench_offset_mm),
              5 * reading.sigma);
}

// The scale of a sensor that moves is 0 where the sensor would touch the rear principal plane.
TEST(MovingFocus, OfTheSensorGivesTheImageDistanceFromTheScale) {
  const SimulatedSweep sweep = MovingSweep(SweepMotion::kSensor, 300, 0.05);
  const Calibration c = CalibrateWithoutMap(sweep);
  ExpectTrue(c, sweep);
  EXPECT_EQ(c.diagnostics.bench_offset_from, "the image scale");
  EXPECT_EQ(c.diagnostics.moves, SweepMotion::kSensor);
  EXPECT_LT(c.summary.image_distance_mm->sigma, 2);
  // The pupil laws move the centre of perspective by a part of the sigma here.
  const Eigen::Vector2d interval = *c.summary.image_distance_mm->systematic;
  EXPECT_GT(interval.x(), 62);
  EXPECT_LT(interval.y(), 66);
  EXPECT_NEAR(c.diagnostics.magnification_at_focus->value, 0.2,
              4 * c.diagnostics.magnification_at_focus->sigma);
  EXPECT_NEAR(c.summary.bench_offset_mm->value, sweep.truth.bench_offset_mm,
              4 * c.summary.bench_offset_mm->sigma);
}

TEST(MovingFocus, OfTheSensorTakesTheReadingsInTheirDirection) {
  SimulatedSweep sweep =
      MovingSweep(SweepMotion::kSensor, 300, 0.05, 2, model::BenchDirection::kToward);
  ExpectTrue(CalibrateWithoutMap(sweep), sweep);
  sweep.sweep.direction = model::BenchDirection::kAway;
  const Calibration c = CalibrateWithoutMap(sweep);
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason, HasSubstr("direction must be 'toward'"));
}

// A statement takes the place of the scale; d1 is then as exact as it is.
TEST(MovingFocus, TakesWhatIsKnownOfThePlaneOfFocus) {
  const SimulatedSweep simulated = MovingSweep(SweepMotion::kSensor, 300, 0.05);
  const double d1_mm = simulated.truth.image_distance_mm;
  const model::StatedConjugate statements[] = {
      {model::ConjugateKind::kFocusDepth, {300, 0.5}, "focus_depth_mm"},
      {model::ConjugateKind::kImageDistance, {d1_mm, 0.02}, "image_distance_mm"},
      {model::ConjugateKind::kMagnification, {0.2, 0.0004}, "magnification"}};
  for (const SweepMotion moves : {SweepMotion::kSensor, SweepMotion::kLens}) {
    SimulatedSweep sweep =
        moves == SweepMotion::kSensor ? simulated : MovingSweep(moves, 300, 0.05);
    for (const model::StatedConjugate& stated : statements) {
      sweep.sweep.stated_focus = {stated};
      const Calibration c = CalibrateWithoutMap(sweep);
      ExpectTrue(c, sweep);
      EXPECT_EQ(c.diagnostics.bench_offset_from, stated.name);
      EXPECT_NEAR(c.summary.image_distance_mm->sigma, 0.02, 0.003) << stated.name;
      EXPECT_LT(c.summary.blur_ratio->sigma, 0.006);
    }
  }
}

// The sources beside the one that is used are listed by their zf, wrong ones with a warning.
TEST(MovingFocus, ListsWhatElseIsKnownOfThePlaneOfFocus) {
  SimulatedSweep sweep = MovingSweep(SweepMotion::kSensor, 300, 0.05);
  sweep.sweep.stated_focus = {
      {model::ConjugateKind::kFocusDepth, {300, 0.5}, "focus_depth_mm"},
      {model::ConjugateKind::kImageDistance, {64, 0.1}, "image_distance_mm"},
      {model::ConjugateKind::kMagnification, {0.25, 0.002}, "magnification"}};
  const Calibration c = CalibrateWithoutMap(sweep);
  // The object distance is less exact at the sensor, because the focal length has an error.
  EXPECT_EQ(c.diagnostics.bench_offset_from, "image_distance_mm");
  std::map<std::string, ComparedFocus> compared;
  for (const ComparedFocus& other : c.diagnostics.compared_focus) compared[other.name] = other;
  EXPECT_EQ(compared.size(), 3U);
  EXPECT_TRUE(compared["focus_depth_mm"].agrees);
  EXPECT_NEAR(compared["focus_depth_mm"].focus_depth_mm.value, 300, 1e-6);
  EXPECT_GE(compared["focus_depth_mm"].focus_depth_mm.sigma, 0.5);
  // f1 = f2 = 50 mm: zf = 250 mm at 1/4.
  EXPECT_FALSE(compared["magnification"].agrees);
  EXPECT_NEAR(compared["magnification"].focus_depth_mm.value, 250, 1e-6);
  EXPECT_TRUE(compared["the image scale"].agrees);
  EXPECT_NEAR(compared["the image scale"].focus_depth_mm.value, 300,
              3 * compared["the image scale"].focus_depth_mm.sigma);
}

// The offset of a focus ring is d1 at reading 0, for example rho + f2 at its stop at infinity.
TEST(MovingFocus, TakesAStatedZeroOfItsScale) {
  for (const SweepMotion moves : {SweepMotion::kSensor, SweepMotion::kLens}) {
    SimulatedSweep sweep = MovingSweep(moves, 300, 0.05);
    sweep.sweep.offset_mm = model::Estimate{sweep.truth.bench_offset_mm, 0.02};
    const Calibration c = CalibrateWithoutMap(sweep);
    ExpectTrue(c, sweep);
    EXPECT_EQ(c.diagnostics.bench_offset_from, "offset_mm");
    EXPECT_NEAR(c.summary.image_distance_mm->sigma, 0.02, 0.005);
  }
}

TEST(MovingFocus, OfALensNeedsAStatementUnlessTheSweepIsLong) {
  const Calibration open = CalibrateWithoutMap(MovingSweep(SweepMotion::kLens, 300, 0.05));
  EXPECT_EQ(open.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(open.summary.reason,
              AllOf(HasSubstr("nothing determines the distance from the lens to the sensor"),
                    HasSubstr("focus_depth_mm")));
  EXPECT_TRUE(open.diagnostics.sharpest.done) << "the reading at focus needs none";
}

// Where a lens stands at 1:1, moving it changes object and image distance alike.
TEST(MovingFocus, OfALensAtOneToOneIsRefusedByName) {
  SimulatedSweep sweep = MovingSweep(SweepMotion::kLens, 300, 0.05);
  sweep.sweep.stated_focus = {{model::ConjugateKind::kMagnification, {1, 0.001}, "magnification"}};
  const Calibration c = CalibrateWithoutMap(sweep);
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason, HasSubstr("at a magnification of 1"));
}

// Without any statement, a sensor that moves is recognised from the scale and confirmed by the fit.
TEST(MovingFocus, IsRecognised) {
  SimulatedSweep sweep = MovingSweep(SweepMotion::kSensor, 300, 0.05);
  sweep.sweep.moves.reset();
  const Calibration c = CalibrateWithoutMap(sweep);
  ExpectTrue(c, sweep);
  EXPECT_TRUE(c.diagnostics.moves_is_recognised);
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("moves: sensor")));
  // If the target is stated to move, that is not changed, and the sweep is refused.
  sweep.sweep.moves = SweepMotion::kTarget;
  EXPECT_EQ(CalibrateWithoutMap(sweep).summary.outcome, Outcome::kRefused);
}

TEST(MovingFocus, ContradictingStatementsAreNamedAndInTheIntervals) {
  SimulatedSweep sweep = MovingSweep(SweepMotion::kSensor, 300, 0.05);
  sweep.sweep.stated_focus = {
      {model::ConjugateKind::kFocusDepth, {300, 0.3}, "focus_depth_mm"},
      {model::ConjugateKind::kMagnification, {0.25, 0.001}, "magnification"}};
  const Calibration c = CalibrateWithoutMap(sweep);
  ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  EXPECT_THAT(c.summary.warnings, Contains(AllOf(HasSubstr("focus_depth_mm puts the sensor 60 "),
                                                 HasSubstr("from that by magnification"))));
  const Eigen::Vector2d interval = *c.summary.image_distance_mm->systematic;
  EXPECT_LE(interval.x(), 64) << "d1 of the true distance";
  EXPECT_GE(interval.y(), 66.5) << "d1 of a magnification of 0.25";
}

// Readings of a focus motor in dioptres: zf is direct, and d1 follows from the focal length.
TEST(MovingFocus, OfDioptresGivesTheFocusDirectly) {
  SimulatedSweep sweep = MovingSweep(SweepMotion::kSensor, 300, 0.05);
  for (std::size_t i = 0; i < sweep.sweep.frames.size(); ++i) {
    sweep.sweep.frames[i].reading_mm =
        model::FocusDepthMm(sweep.sweep.camera.lens, sweep.truth.frames[i].image_distance_mm);
  }
  sweep.sweep.readings_are_focus_distances = true;
  sweep.sweep.reading_sigma_mm = 0.03;
  sweep.sweep.moves.reset();
  const Calibration c = CalibrateWithoutMap(sweep);
  ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  const Result& zf = *c.summary.focus_depth_mm;
  EXPECT_NEAR(zf.value, 300, 5 * zf.sigma);
  EXPECT_LT(zf.sigma, 0.2);
  EXPECT_NEAR(c.summary.image_distance_mm->value, 64, 0.05);
  // The image scale shows that it is the sensor and not the lens.
  EXPECT_THAT(c.summary.warnings,
              Contains(AllOf(HasSubstr("of what the dioptres"), HasSubstr("or the sensor moves"))));
  // A lens that moves and a sensor that moves differ by m^2 in the growth of the blur.
  EXPECT_NEAR(c.summary.blur_ratio->value, 0.45, 0.45 * 0.05);
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("moves: lens")));
  ASSERT_TRUE(c.diagnostics.focus_positions);
  EXPECT_EQ(c.diagnostics.focus_positions->unit, "dpt");
  EXPECT_NEAR(c.diagnostics.focus_positions->ImageDistanceMm(1000.0 / 300), 64, 0.01);
  sweep.sweep.moves = SweepMotion::kSensor;
  const Calibration stated = CalibrateWithoutMap(sweep);
  EXPECT_THAT(stated.summary.warnings, Not(Contains(HasSubstr("of what the dioptres"))));
  EXPECT_NEAR(stated.summary.blur_ratio->value, 0.45, 4 * stated.summary.blur_ratio->sigma + 0.002);
}

TEST(MovingFocus, GivesTheImageDistanceOfEveryPosition) {
  SimulatedSweep sweep = MovingSweep(SweepMotion::kLens, 300, 0.05);
  sweep.sweep.stated_focus = {{model::ConjugateKind::kFocusDepth, {300, 0.01}, "focus_depth_mm"}};
  const Calibration c = CalibrateWithoutMap(sweep);
  ASSERT_TRUE(c.diagnostics.focus_positions) << c.summary.reason;
  const model::Camera camera = CalibratedCamera(sweep.sweep.camera, c, false);
  EXPECT_FALSE(camera.calibration->bench_offset_mm) << "the zero of a lens's scale is no depth";
  for (std::size_t i = 0; i < sweep.truth.frames.size(); ++i) {
    EXPECT_NEAR(
        camera.calibration->focus_positions->ImageDistanceMm(sweep.sweep.frames[i].reading_mm),
        sweep.truth.frames[i].image_distance_mm, 0.01);
    EXPECT_NEAR(*c.frames[i].image_distance_mm, sweep.truth.frames[i].image_distance_mm, 0.01);
  }
  EXPECT_THROW(camera.calibration->focus_positions->ImageDistanceMm(1000), Error);
}

// The blur of each frame is that of the calibrated camera at the frame's depth.
TEST(MovingFocus, DepthsOfFramesAreThoseOfTheirBlur) {
  SimulatedSweep sweep = MovingSweep(SweepMotion::kSensor, 300, 0.05);
  sweep.sweep.stated_focus = {{model::ConjugateKind::kFocusDepth, {300, 0.01}, "focus_depth_mm"}};
  const Calibration c = CalibrateWithoutMap(sweep);
  ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  const model::Camera& camera = sweep.sweep.camera;
  for (std::size_t i = 0; i < c.frames.size(); ++i) {
    ASSERT_GT(c.frames[i].depth_mm, 0);
    const double blur_px = 0.45 * model::BlurRadiusMm(camera.lens, 64, c.frames[i].depth_mm) /
                           camera.sensor.pixel_pitch_mm;
    EXPECT_NEAR(std::hypot(sweep.truth.blur_floor_px, blur_px), sweep.truth.frames[i].blur_sigma_px,
                0.15);
  }
}

// A tilted target is tilted by the same angle, whatever moves.
TEST(MovingFocus, GivesTheTiltOfTheTarget) {
  for (const SweepMotion moves : {SweepMotion::kSensor, SweepMotion::kLens}) {
    SimulatedSweep sweep = MovingSweep(moves, 300, 0.05, 3, model::BenchDirection::kAway, 8);
    sweep.sweep.stated_focus = {{model::ConjugateKind::kFocusDepth, {300, 0.3}, "focus_depth_mm"}};
    const Calibration c = Calibrate(sweep.sweep, CalibrationOptions{});
    ASSERT_TRUE(c.diagnostics.field.tilt_right_deg) << c.summary.reason;
    EXPECT_NEAR(c.diagnostics.field.tilt_right_deg->value, 8,
                4 * c.diagnostics.field.tilt_right_deg->sigma + 0.8);
  }
}

// An image distance that is wrong is contradicted by the scale on the right side.
TEST(MovingFocus, OfTheSensorIsComparedWithTheScale) {
  SimulatedSweep sweep = MovingSweep(SweepMotion::kSensor, 300, 0.05);
  const double d1_mm = sweep.truth.image_distance_mm;
  for (const double off_mm : {-3.0, 3.0}) {
    sweep.sweep.stated_focus = {
        {model::ConjugateKind::kImageDistance, {d1_mm + off_mm, 0.05}, "image_distance_mm"}};
    const Calibration c = CalibrateWithoutMap(sweep);
    ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
    EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("the image scale puts the sensor")));
    const Eigen::Vector2d interval = *c.summary.image_distance_mm->systematic;
    EXPECT_LE(interval.x(), d1_mm);
    EXPECT_GE(interval.y(), d1_mm);
  }
}

// The sigmas of d1, zf and kappa are the scatter of many noisy sweeps.
TEST(SlowMovingFocus, SigmasAreTheScatter) {
  constexpr int kRuns = 24;
  double d1_chi2 = 0, zf_chi2 = 0, ratio_chi2 = 0;
  for (int run = 0; run < kRuns; ++run) {
    const SimulatedSweep sweep =
        MovingSweep(SweepMotion::kSensor, 300, 0.05, 100U + static_cast<std::uint64_t>(run));
    const Calibration c = CalibrateWithoutMap(sweep);
    ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
    const auto square = [](const Result& r, double truth) {
      return std::pow((r.value - truth) / r.sigma, 2);
    };
    d1_chi2 += square(*c.summary.image_distance_mm, 64) / kRuns;
    zf_chi2 += square(*c.summary.focus_depth_mm, 300) / kRuns;
    ratio_chi2 += square(*c.summary.blur_ratio, 0.45) / kRuns;
  }
  // 99.9 % of the mean of 24 squares is below 2.2; errors of the scale are stated on the safe side.
  for (const double chi2 : {d1_chi2, zf_chi2, ratio_chi2}) {
    EXPECT_LT(chi2, 2.2);
    EXPECT_GT(chi2, 0.15);
  }
}

// Counts of 2.5 um, from which the image scale and a statement of the plane of focus give mm.
SimulatedSweep InCounts(SimulatedSweep sweep) {
  constexpr double kMmPerStep = 0.0025;
  for (model::SweepFrame& frame : sweep.sweep.frames)
    frame.reading_mm = 4000 + frame.reading_mm / kMmPerStep;
  sweep.sweep.reading_sigma_mm /= kMmPerStep;
  sweep.sweep.readings_are_counts = true;
  return sweep;
}

TEST(CountedFocus, AStatementGivesTheLengthOfAStep) {
  for (const SweepMotion moves : {SweepMotion::kSensor, SweepMotion::kLens}) {
    SimulatedSweep sweep = InCounts(MovingSweep(moves, 300, 0.05));
    sweep.sweep.stated_focus = {{model::ConjugateKind::kFocusDepth, {300, 0.5}, "focus_depth_mm"}};
    const Calibration c = CalibrateWithoutMap(sweep);
    ASSERT_NE(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
    ASSERT_TRUE(c.diagnostics.step_length_mm);
    const model::Estimate& length = *c.diagnostics.step_length_mm;
    EXPECT_NEAR(length.value, 0.0025, 4 * length.sigma);
    EXPECT_LT(length.sigma, 0.03 * 0.0025);
    EXPECT_NEAR(c.summary.image_distance_mm->value, sweep.truth.image_distance_mm,
                4 * c.summary.image_distance_mm->sigma);
    EXPECT_NEAR(c.summary.blur_ratio->value, sweep.truth.blur_ratio,
                4 * c.summary.blur_ratio->sigma);
    EXPECT_LT(c.summary.blur_ratio->sigma, 0.04);
    // The reading at focus was 3 mm.
    EXPECT_NEAR(c.diagnostics.focus_reading_mm->value, 5200,
                5 * c.diagnostics.focus_reading_mm->sigma);
    ASSERT_TRUE(c.diagnostics.focus_positions);
    EXPECT_EQ(c.diagnostics.focus_positions->unit, "steps");
    EXPECT_NEAR(c.diagnostics.focus_positions->ImageDistanceMm(5200),
                c.summary.image_distance_mm->value, 0.01);
    EXPECT_EQ(c.frames.front().reading_mm, sweep.sweep.frames.front().reading_mm);
  }
}

TEST(CountedFocus, WithoutAStatementSaysWhatIsDeterminedAndWhatToState) {
  SimulatedSweep sweep = InCounts(MovingSweep(SweepMotion::kSensor, 300, 0.05));
  const Calibration c = CalibrateWithoutMap(sweep);
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason, AllOf(HasSubstr("length of a step"), HasSubstr("count at focus, 5"),
                                      HasSubstr("focus_depth_mm"), HasSubstr("--reading-scale")));
  ASSERT_TRUE(c.diagnostics.sharpest.done);
  EXPECT_NEAR(c.diagnostics.sharpest.reading_mm.value, 5200, 10);
  sweep.sweep.moves.reset();
  EXPECT_THAT(CalibrateWithoutMap(sweep).summary.reason,
              AllOf(HasSubstr("steps"), HasSubstr("--reading-scale"), HasSubstr("moves: lens")));
}

// Messages name the position of the drive, and not that of the equivalent target.
TEST(MovingFocus, ARejectedFrameHasTheReadingsOfTheSweep) {
  SimulatedSweep sweep = MovingSweep(SweepMotion::kSensor, 300, 0.05);
  const double right_mm = sweep.sweep.frames[4].reading_mm;
  sweep.sweep.frames[4].reading_mm += 0.4;
  const Calibration c = CalibrateWithoutMap(sweep);
  const std::string& rejection = c.frames[4].rejection;
  ASSERT_THAT(rejection, HasSubstr("reading off by 0."));
  const std::string before = "belongs to the reading ";
  const auto at = rejection.find(before);
  ASSERT_NE(at, std::string::npos) << rejection;
  EXPECT_NEAR(std::stod(rejection.substr(at + before.size())), right_mm, 0.03) << rejection;
}

}  // namespace
}  // namespace thicklens::calib
