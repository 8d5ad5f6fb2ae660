#include "thicklens/calib/calibrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "tests/calib/damaged_sweep.h"
#include "tests/calib/simulated_sweep.h"
#include "thicklens/base/cancel.h"
#include "thicklens/model/camera_file.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::DeepCopy;
using thicklens::testing::ErrorOf;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepWithFloor;

constexpr int kSizePx = 160;

// Case iii on a small field with dead leaves. The floor and the bench offset are given.
SimulatedSweep Good() {
  static const SimulatedSweep rendered = SweepWithFloor("iii", kSizePx, 1);
  return DeepCopy(rendered);
}

void Keep(SimulatedSweep* simulated, std::size_t first, std::size_t count) {
  auto& frames = simulated->sweep.frames;
  frames = {frames.begin() + static_cast<std::ptrdiff_t>(first),
            frames.begin() + static_cast<std::ptrdiff_t>(first + count)};
  auto& stored = *simulated->stored;
  stored = {stored.begin() + static_cast<std::ptrdiff_t>(first),
            stored.begin() + static_cast<std::ptrdiff_t>(first + count)};
}

Calibration Calibrated(const SimulatedSweep& simulated) {
  Calibration c = Calibrate(simulated.sweep, {});
  return c;
}

void ExpectRefused(const Calibration& c, const std::string& why) {
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
  EXPECT_THAT(c.summary.reason, HasSubstr(why));
  EXPECT_FALSE(c.summary.image_distance_mm);
  EXPECT_FALSE(c.summary.focus_depth_mm);
  EXPECT_FALSE(c.summary.blur_ratio);
}

// Expects that the results are right within their own errors and that these are small.
void ExpectRight(const Calibration& c, const model::SweepTruth& truth) {
  ASSERT_TRUE(c.summary.focus_depth_mm) << c.summary.reason;
  EXPECT_EQ(c.summary.outcome, Outcome::kOk) << c.summary.reason;
  EXPECT_LT(std::abs(c.summary.focus_depth_mm->value - truth.focus_depth_mm),
            3 * c.summary.focus_depth_mm->sigma);
  EXPECT_LT(c.summary.focus_depth_mm->sigma, 0.15);
  EXPECT_NEAR(c.summary.blur_ratio->value / truth.blur_ratio, 1, 0.005);
  EXPECT_NEAR(c.summary.image_distance_mm->value, truth.image_distance_mm,
              3 * c.summary.image_distance_mm->sigma);
}

TEST(Calibrate, AGoodSweepIsRight) { ExpectRight(Calibrated(Good()), Good().truth); }

TEST(Calibrate, OneAndTwoThreadsGiveTheSameBits) {
  const SimulatedSweep good = Good();
  CalibrationOptions options;
  options.threads = 1;
  const Calibration one = Calibrate(good.sweep, options);
  options.threads = 2;
  const Calibration two = Calibrate(good.sweep, options);
  ASSERT_TRUE(one.summary.focus_depth_mm && two.summary.focus_depth_mm);
  EXPECT_EQ(one.summary.focus_depth_mm->value, two.summary.focus_depth_mm->value);
  EXPECT_EQ(one.summary.focus_depth_mm->sigma, two.summary.focus_depth_mm->sigma);
  EXPECT_EQ(one.summary.blur_ratio->value, two.summary.blur_ratio->value);
  EXPECT_EQ(one.diagnostics.scale.offset_mm.value, two.diagnostics.scale.offset_mm.value);
  EXPECT_EQ(one.diagnostics.paper_recipe.blur_ratio, two.diagnostics.paper_recipe.blur_ratio);
  EXPECT_TRUE(one.diagnostics.covariance == two.diagnostics.covariance);
}

TEST(Calibrate, TheSourcesRecipeAndThePeakNeedNoFit) {
  const SimulatedSweep good = Good();
  const Calibration whole = Calibrated(good);
  CalibrationOptions options;
  options.fit_blur = false;
  const Calibration alone = Calibrate(good.sweep, options);
  EXPECT_EQ(alone.summary.outcome, Outcome::kPartial);
  EXPECT_EQ(alone.summary.reason, "the fit of the blur was not requested");
  ASSERT_TRUE(alone.diagnostics.paper_recipe.done && alone.diagnostics.sharpness.done);
  EXPECT_EQ(alone.diagnostics.paper_recipe.focus_depth_mm,
            whole.diagnostics.paper_recipe.focus_depth_mm);
  EXPECT_EQ(alone.diagnostics.paper_recipe.blur_ratio, whole.diagnostics.paper_recipe.blur_ratio);
  EXPECT_EQ(alone.diagnostics.sharpness.focus_depth_mm, whole.diagnostics.sharpness.focus_depth_mm);
  EXPECT_FALSE(alone.summary.image_distance_mm || alone.summary.blur_ratio ||
               alone.diagnostics.blur.done || alone.diagnostics.field.done);
  EXPECT_FALSE(alone.diagnostics.scale.done);  // the bench offset is given
}

TEST(Calibrate, WithoutFitAnUnknownBenchZeroIsStillFound) {
  SimulatedSweep s = Good();
  s.sweep.offset_mm.reset();
  CalibrationOptions options;
  options.fit_blur = false;
  const Calibration alone = Calibrate(s.sweep, options);
  ASSERT_TRUE(alone.diagnostics.scale.done && alone.summary.bench_offset_mm);
  EXPECT_NEAR(alone.summary.bench_offset_mm->value, s.truth.bench_offset_mm,
              4 * alone.summary.bench_offset_mm->sigma);
  EXPECT_NEAR(alone.diagnostics.sharpness.focus_depth_mm,
              Calibrated(s).diagnostics.sharpness.focus_depth_mm, 0.1);
}

TEST(Calibrate, ThreeFramesAreTooFew) {
  SimulatedSweep s = Good();
  Keep(&s, 18, 3);
  ExpectRefused(Calibrated(s), "at least 5 frames, this one has 3");
}

TEST(Calibrate, EqualReadingsAreNamed) {
  SimulatedSweep s = Good();
  for (model::SweepFrame& frame : s.sweep.frames) frame.reading_mm = 412;
  ExpectRefused(Calibrated(s), "different readings, this one has 1 (all are 412 mm)");
}

TEST(Calibrate, ABlankTargetShowsNoTexture) {
  SimulatedSweep s = Good();
  cv::RNG random(4);
  for (cv::Mat& frame : *s.stored) {
    cv::Mat noise(frame.size(), CV_32F);
    random.fill(noise, cv::RNG::NORMAL, 110, 3);
    noise.convertTo(frame, CV_8U);
  }
  ExpectRefused(Calibrated(s), "no texture above the noise");
}

TEST(Calibrate, ADarkSweepIsNamedDark) {
  SimulatedSweep s = Good();
  for (cv::Mat& frame : *s.stored) frame.setTo(1);
  ExpectRefused(Calibrated(s), "under-exposed: raise the exposure");
}

TEST(Calibrate, AFrameOfAnotherSizeIsAnErrorThatNamesIt) {
  SimulatedSweep s = Good();
  s.frame(7) = cv::Mat(kSizePx, kSizePx + 1, CV_8U, cv::Scalar(100));
  EXPECT_THAT(ErrorOf([&] { Calibrated(s); }), HasSubstr("frame-7: the image has 161 x 160 px"));
}

TEST(Calibrate, AReversedDirectionIsRefusedByItsName) {
  SimulatedSweep s = Good();
  s.sweep.offset_mm.reset();
  s.sweep.direction = model::BenchDirection::kToward;
  ExpectRefused(Calibrated(s), "direction must be 'away'");
}

TEST(Calibrate, AnUnknownBenchZeroIsFound) {
  SimulatedSweep s = Good();
  s.sweep.offset_mm.reset();
  for (model::SweepFrame& frame : s.sweep.frames) frame.reading_mm -= 45;
  const Calibration c = Calibrated(s);
  ASSERT_TRUE(c.summary.bench_offset_mm) << c.summary.reason;
  EXPECT_NEAR(c.summary.bench_offset_mm->value, 45, 3 * c.summary.bench_offset_mm->sigma);
  ASSERT_TRUE(c.summary.focus_depth_mm);
  EXPECT_NEAR(c.summary.focus_depth_mm->value, s.truth.focus_depth_mm,
              3 * c.summary.focus_depth_mm->sigma);
  // The error of the bench offset is contained in that of the focus.
  EXPECT_GE(c.summary.focus_depth_mm->sigma, 0.8 * c.summary.bench_offset_mm->sigma);
}

TEST(Calibrate, OneImageRepeatedIsRefused) {
  SimulatedSweep s = Good();
  for (cv::Mat& frame : *s.stored) frame = s.frame(16).clone();
  {
    SCOPED_TRACE("bench offset given");
    const Calibration c = Calibrated(s);
    EXPECT_EQ(c.summary.outcome, Outcome::kRefused) << c.summary.reason;
    EXPECT_FALSE(c.summary.blur_ratio);
  }
  s.sweep.offset_mm.reset();
  ExpectRefused(Calibrated(s), "does not change with the reading");
}

// The plane of focus at 400 mm lies between frames 19 and 20 of 41, at a step of 4 mm. A focus
// outside the sweep is accepted, with a warning, if its standard deviation is below one step. The
// 11 frames here end 29 and 31 mm short of the focus and determine it to 2 mm.
TEST(Calibrate, AFocusBeyondTheSweepIsExtrapolatedWithAWarning) {
  for (const bool nearer : {false, true}) {
    SCOPED_TRACE(nearer);
    SimulatedSweep s = Good();
    Keep(&s, nearer ? 27 : 2, 11);
    const Calibration c = Calibrated(s);
    EXPECT_EQ(c.summary.outcome, Outcome::kOk) << c.summary.reason;
    EXPECT_THAT(c.summary.warnings,
                Contains(AllOf(HasSubstr("is extrapolated"),
                               HasSubstr(nearer ? "nearer than" : "farther than"))));
    ASSERT_TRUE(c.summary.focus_depth_mm);
    EXPECT_NEAR(c.summary.focus_depth_mm->value, s.truth.focus_depth_mm,
                4 * c.summary.focus_depth_mm->sigma);
    EXPECT_LT(c.summary.focus_depth_mm->sigma, 4);
  }
}

// The 8 frames here end 51 and 45 mm short of the focus and determine it to 9 and 8 mm only.
TEST(Calibrate, AFocusFarBeyondTheSweepIsRefusedWithItsSide) {
  for (const bool nearer : {false, true}) {
    SCOPED_TRACE(nearer);
    SimulatedSweep s = Good();
    Keep(&s, nearer ? 31 : 0, 8);
    ExpectRefused(Calibrated(s), nearer ? "sharpness is monotone: the focus lies nearer"
                                        : "sharpness is monotone: the focus lies farther");
  }
}

TEST(Calibrate, AWrongFocalLengthIsRefusedAsUnphysical) {
  SimulatedSweep s = SweepWithFloor("ii", kSizePx, 1);
  s.sweep.camera.lens.front_focal_length_mm = s.sweep.camera.lens.rear_focal_length_mm = 35;
  // The radius of the aperture follows from the f-number.
  s.sweep.camera.lens.aperture_radius_mm *= 35.0 / 50;
  ExpectRefused(Calibrated(s), "which no lens has");
}

// Other threads go on with their frames until the exception has been noted, for
// as long as the machine lets the throwing thread wait.
TEST(Calibrate, StopsWhenProgressThrows) {
  const SimulatedSweep s = Good();
  for (const int threads : {1, 2}) {
    SCOPED_TRACE(threads);
    CalibrationOptions options;
    options.threads = threads;
    int calls = 0, last = 0;
    options.progress = [&](int done, int total) {
      EXPECT_GT(done, last);
      EXPECT_LE(done, total);
      last = done;
      if (++calls == 10) throw std::runtime_error("enough");
    };
    EXPECT_THROW(Calibrate(s.sweep, options), std::runtime_error);
    if (threads == 1) {
      EXPECT_EQ(calls, 10);
    }
  }
}

// Whatever step is interrupted, the interruption is not mistaken for a frame or a fit that failed.
TEST(Calibrate, IsCancelledAtEachStep) {
  const SimulatedSweep s = Good();
  CalibrationOptions options;
  options.threads = 1;
  int steps = 0;
  options.progress = [&](int, int) { ++steps; };
  Calibrate(s.sweep, options);
  for (int at = 1; at <= steps; at += 1 + steps / 4) {
    CancelToken token;
    const CancelScope scope(&token);
    int step = 0;
    options.progress = [&](int, int) {
      if (++step == at) token.Cancel();
    };
    EXPECT_THROW(Calibrate(s.sweep, options), Interrupted) << "at step " << at << " of " << steps;
    EXPECT_LE(step, at + 1);
  }
}

// d1 = rho + f2 zf/(zf - f1), so the tolerance of f2 is multiplied by zf/(zf - f1). The tolerance
// of the pitch changes kappa in proportion.
TEST(Calibrate, StatedTolerancesWidenTheSystematicInterval) {
  SimulatedSweep s = Good();
  const Calibration exact = Calibrated(s);
  s.sweep.camera.statements["lens.rear_focal_length_mm"] = {0.1, false};
  s.sweep.camera.statements["sensor.pixel_pitch_mm"] = {0.02 * s.sweep.camera.sensor.pixel_pitch_mm,
                                                        false};
  const Calibration c = Calibrated(s);
  ASSERT_TRUE(exact.summary.image_distance_mm && c.summary.image_distance_mm);
  EXPECT_EQ(c.summary.image_distance_mm->value, exact.summary.image_distance_mm->value);
  const double zf = c.summary.focus_depth_mm->value;
  const double half_mm = 0.1 * zf / (zf - s.sweep.camera.lens.front_focal_length_mm);
  EXPECT_NEAR(c.summary.image_distance_mm->systematic->y() -
                  exact.summary.image_distance_mm->systematic->y(),
              half_mm, 1e-3);
  // The limited accuracy of the blur estimator and all other parts are added in quadrature.
  const double before = exact.summary.blur_ratio->systematic->y() - exact.summary.blur_ratio->value;
  const double after = c.summary.blur_ratio->systematic->y() - c.summary.blur_ratio->value;
  EXPECT_NEAR(std::sqrt(after * after - before * before), 0.02 * c.summary.blur_ratio->value,
              0.001 * c.summary.blur_ratio->value);
}

TEST(Calibrate, ABlackAndAnOverexposedFrameAreRejectedByName) {
  SimulatedSweep s = Good();
  s.frame(5).setTo(0);
  s.frame(30).convertTo(s.frame(30), CV_8U, 4);
  const Calibration c = Calibrated(s);
  ExpectRight(c, s.truth);
  EXPECT_THAT(c.frames[5].rejection, HasSubstr("dark"));
  EXPECT_THAT(c.frames[30].rejection, HasSubstr("saturated"));
  EXPECT_EQ(std::count_if(c.frames.begin(), c.frames.end(),
                          [](const FrameMeasurement& f) { return !f.rejection.empty(); }),
            2);
  EXPECT_EQ(c.summary.frames_used, c.diagnostics.blur.frames_used);
  EXPECT_GE(c.summary.frames_used, 37);
}

TEST(Calibrate, SwappedReadingsAreNamedAndDoNoHarm) {
  SimulatedSweep s = Good();
  std::swap(s.sweep.frames[4].reading_mm, s.sweep.frames[12].reading_mm);
  const Calibration c = Calibrated(s);
  ExpectRight(c, s.truth);
  EXPECT_THAT(c.frames[4].rejection, HasSubstr("swapped with frame-12"));
  EXPECT_THAT(c.frames[12].rejection, HasSubstr("swapped with frame-4"));
  for (const std::size_t i : {4U, 12U}) EXPECT_FALSE(c.frames[i].in_blur_fit) << i;
}

TEST(Calibrate, AnUnknownFloorLeavesItUnwrittenAndTheTruthInsideTheInterval) {
  SimulatedSweep s = Good();
  s.sweep.floor = {};
  const Calibration c = Calibrated(s);
  EXPECT_EQ(c.summary.outcome, Outcome::kPartial);
  EXPECT_THAT(c.summary.reason, HasSubstr("the blur floor is not determined"));
  ASSERT_TRUE(c.summary.focus_depth_mm && c.summary.focus_depth_mm->systematic);
  const Eigen::Vector2d interval = *c.summary.focus_depth_mm->systematic;
  EXPECT_GT(s.truth.focus_depth_mm, interval.x() - 3 * c.summary.focus_depth_mm->sigma);
  EXPECT_LT(s.truth.focus_depth_mm, interval.y() + 3 * c.summary.focus_depth_mm->sigma);
  EXPECT_GT(interval.y() - interval.x(), 0.5);
}

TEST(CalibratedCamera, KeepsTheMakersValuesAndSurvivesItsFile) {
  SimulatedSweep s = Good();
  const Calibration c = Calibrated(s);
  model::Camera typed_in = s.sweep.camera;
  typed_in.statements["lens.aperture_radius_mm"] = {0.1, true};
  const model::Camera camera = CalibratedCamera(typed_in, c, false);
  EXPECT_EQ(camera.lens.front_focal_length_mm, typed_in.lens.front_focal_length_mm);
  EXPECT_EQ(camera.lens.rear_focal_length_mm, typed_in.lens.rear_focal_length_mm);
  EXPECT_EQ(camera.lens.lens_thickness_mm, typed_in.lens.lens_thickness_mm);
  EXPECT_EQ(camera.lens.aperture_radius_mm, typed_in.lens.aperture_radius_mm);
  EXPECT_EQ(camera.sensor.pixel_pitch_mm, typed_in.sensor.pixel_pitch_mm);
  EXPECT_EQ(camera.statements.size(), 1U);

  const model::Camera read = model::ParseCamera(model::CameraToYaml(camera), "written");
  ASSERT_TRUE(read.calibration);
  EXPECT_EQ(read.image_distance_mm(), c.summary.image_distance_mm->value);
  EXPECT_EQ(read.blur_ratio(), c.summary.blur_ratio->value);
  EXPECT_EQ(read.calibration->covariance_order, c.diagnostics.covariance_order);
  EXPECT_TRUE(read.calibration->covariance == c.diagnostics.covariance);
  EXPECT_EQ(read.calibration->blur_floor_px->value, c.summary.blur_floor_px->value);
  EXPECT_EQ(read.calibration->bench_offset_mm->value, c.summary.bench_offset_mm->value);
  EXPECT_NEAR(std::sqrt(c.diagnostics.covariance(0, 0)), c.summary.image_distance_mm->sigma,
              1e-9 * c.summary.image_distance_mm->sigma);
}

TEST(CalibratedCamera, DoesNotWriteWhatTheDataDidNotFix) {
  SimulatedSweep s = Good();
  s.sweep.floor = {};
  const model::Camera camera = CalibratedCamera(s.sweep.camera, Calibrated(s), false);
  ASSERT_TRUE(camera.calibration);
  EXPECT_FALSE(camera.calibration->blur_floor_px);
  EXPECT_TRUE(camera.calibration->image_distance_mm);
  EXPECT_THAT(camera.calibration->covariance_order, Not(Contains("blur_floor_px")));
  EXPECT_EQ(camera.calibration->covariance.rows(), 3);
  EXPECT_EQ(model::CameraToYaml(camera).find("blur_floor_px"), std::string::npos);
}

}  // namespace
}  // namespace thicklens::calib
