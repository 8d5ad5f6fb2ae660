// Whole sweeps with faults that resemble other faults. The stated reason must be the cause, and
// results that could be determined nevertheless must be reported.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>

#include "support/test_cameras.h"
#include "tests/calib/calibrated_sweep.h"
#include "tests/calib/damaged_sweep.h"
#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using namespace thicklens::testing;

constexpr int kSizePx = 192;

// A lens of 50 mm f/2.8 in focus at 300 mm, with 31 frames at steps of 1 mm.
SimulatedSweep Good() {
  static const SimulatedSweep rendered = SweepWithFloor("ii", kSizePx, 1);
  return DeepCopy(rendered);
}

void ExpectSharpestAt(const Calibration& c, double reading_mm, double within_mm) {
  ASSERT_TRUE(c.diagnostics.sharpest.done) << c.diagnostics.sharpest.message;
  EXPECT_NEAR(c.diagnostics.sharpest.reading_mm.value, reading_mm, within_mm);
  EXPECT_NEAR(c.diagnostics.sharpest.reading_mm.value, reading_mm,
              4 * c.diagnostics.sharpest.reading_mm.sigma);
  EXPECT_LT(c.diagnostics.sharpest.reading_mm.sigma, within_mm);
}

TEST(Reason, ReadingsInInchesWithAStatedErrorAreStillAskedAbout) {
  SimulatedSweep s = Good();
  s.sweep.offset_mm.reset();
  for (model::SweepFrame& frame : s.sweep.frames)
    frame.reading_mm = (frame.reading_mm - 190) / 25.4;
  s.sweep.reading_sigma_mm = 0.05;  // 4 % of the range of the readings
  const Calibration c = CalibrateWithoutMap(s);
  EXPECT_EQ(c.summary.outcome, Outcome::kRefused);
  EXPECT_THAT(c.summary.reason,
              AllOf(StartsWith("the image scale puts the target at 1"),
                    HasSubstr("that the readings are in mm. With readings in inches"),
                    Not(HasSubstr("does not follow"))));
  ExpectSharpestAt(c, 110 / 25.4, 0.03);
}

// Scales all frames to one size with mirrored borders, as focus stacking programs do.
TEST(Reason, AlignedFramesAreNotCalledDistorted) {
  SimulatedSweep s = Good();
  for (std::size_t i = 0; i < s.stored->size(); ++i) {
    cv::Mat& frame = (*s.stored)[i];
    const double scale = s.truth.frames[i].depth_mm / 300;
    const double centre = 0.5 * (frame.cols - 1);
    const cv::Matx23d map(scale, 0, centre * (1 - scale), 0, scale, centre * (1 - scale));
    cv::warpAffine(frame.clone(), frame, map, frame.size(), cv::INTER_CUBIC, cv::BORDER_REFLECT);
  }
  const Calibration c = CalibrateWithoutMap(s);
  std::string said = c.summary.reason;
  for (const std::string& warning : c.summary.warnings) said += " | " + warning;
  EXPECT_THAT(said, AllOf(HasSubstr("the image scale does not change with the reading, although it "
                                    "should change by 11 % according to offset_mm"),
                          HasSubstr("aligned"), HasSubstr("telecentric"),
                          Not(HasSubstr("distorted")), Not(HasSubstr("undistort"))));
  EXPECT_FALSE(c.diagnostics.scale.distortion_at_corner);
  ExpectSharpestAt(c, 300, 0.7);
}

// The target of the sweeps below has blots of all sizes, so that every frame contains the same
// ones.
model::LinearImage Blots() {
  constexpr int kSide = 900;
  cv::Mat image(kSide, kSide, CV_32F, cv::Scalar(0.5));
  std::mt19937 engine(4);
  const auto uniform = [&engine] { return static_cast<double>(engine()) / 4294967296.0; };
  for (int i = 0; i < 6000; ++i) {
    const double radius = std::min(60.0, 3 / std::sqrt(0.002 + uniform()));
    cv::circle(image, {static_cast<int>(kSide * uniform()), static_cast<int>(kSide * uniform())},
               static_cast<int>(radius), cv::Scalar(0.2 + 0.5 * uniform()), -1);
  }
  model::LinearImage result;
  result.width_px = result.height_px = kSide;
  result.channels = 1;
  result.values.assign(image.begin<float>(), image.end<float>());
  return result;
}

// The target is at 300 mm, and the sensor moves by +-0.6 mm, about 60 mm behind the lens.
SimulatedSweep FocusRing() {
  const model::LinearImage target = Blots();
  SimulatedSweep sweep;
  sweep.stored = std::make_shared<std::vector<cv::Mat>>();
  for (int k = -12; k <= 12; ++k) {
    model::SweepSimulationOptions options = SweepCase("ii", kSizePx, 1);
    options.target.kind = model::TargetKind::kImage;
    options.target.feature_size_mm = 14;
    options.first_depth_mm = 300;
    options.frame_count = 1;
    options.drift_sigma_px = 0;
    options.flicker = 0;
    options.light_level = 0.4;
    options.lamp_falloff = false;
    options.camera.calibration->image_distance_mm = model::Estimate{60 + 0.05 * k, 0};
    SimulatedSweep one = Simulate(options, target);
    sweep.stored->push_back(one.frame(0));
    if (k == -12) sweep.sweep = one.sweep;
  }
  sweep.sweep.frames.clear();
  for (int k = -12; k <= 12; ++k) sweep.sweep.frames.push_back({"frame", 0.05 * k});
  sweep.sweep.offset_mm.reset();
  sweep.sweep.reading_sigma_mm = 0.001;
  sweep.sweep.read_frame = [stored = sweep.stored](std::size_t i) { return (*stored)[i]; };
  return sweep;
}

TEST(Reason, ALensThatMovesIsNamedAndNotTheDirectionOrTheUnit) {
  SimulatedSweep s = FocusRing();
  s.sweep.moves = model::SweepMotion::kTarget;  // otherwise it is taken as a sensor that moves
  for (const auto direction : {model::BenchDirection::kAway, model::BenchDirection::kToward}) {
    s.sweep.direction = direction;
    const Calibration c = CalibrateWithoutMap(s);
    EXPECT_EQ(c.summary.outcome, Outcome::kRefused);
    EXPECT_THAT(
        c.summary.reason,
        AllOf(StartsWith("the image scale follows the lens, not the target"),
              Not(HasSubstr("direction must be")), Not(HasSubstr("that the readings are in mm")),
              Not(HasSubstr("no lens has"))));
    ExpectSharpestAt(c, 0, 0.03);
    ASSERT_TRUE(c.diagnostics.scale.change_over_sweep);
    EXPECT_NEAR(c.diagnostics.scale.change_over_sweep->value, -0.02, 0.001);
  }
}

// The bands prevent most frames from being registered to one another.
TEST(Reason, AFlickeringLampIsNamedWhereFramesDoNotRegister) {
  SimulatedSweep s = Good();
  std::mt19937 engine(2);
  for (cv::Mat& frame : *s.stored) {
    const double phase = static_cast<double>(engine()) / 4294967296.0 * 2 * CV_PI;
    for (int y = 0; y < frame.rows; ++y) {
      const double gain = 1 + 0.4 * std::sin(2 * CV_PI * y / 30 + phase);
      cv::Mat row = frame.row(y);
      row.convertTo(row, CV_8U, gain);
    }
  }
  const Calibration c = CalibrateWithoutMap(s);
  std::string said = c.summary.reason;
  for (const std::string& warning : c.summary.warnings) said += " | " + warning;
  EXPECT_THAT(said, AllOf(HasSubstr("whole rows brighten together"), HasSubstr("rolling shutter"),
                          Not(HasSubstr("knife-edge or"))));
}

TEST(Reason, AGoodSweepHasNoCause) {
  const Calibration c = CalibrateWithoutMap(Good());
  EXPECT_EQ(c.summary.outcome, Outcome::kOk) << c.summary.reason;
  EXPECT_THAT(c.summary.warnings, Each(Not(AnyOf(HasSubstr("bands"), HasSubstr("darker"),
                                                 HasSubstr("moves"), HasSubstr("distort")))));
  ExpectSharpestAt(c, 300, 0.7);
  ASSERT_TRUE(c.diagnostics.focus_reading_mm);
  EXPECT_NEAR(c.diagnostics.focus_reading_mm->value, 300,
              4 * c.diagnostics.focus_reading_mm->sigma);
}

}  // namespace
}  // namespace thicklens::calib
