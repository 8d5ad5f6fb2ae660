// Calibrations of sweeps of a grid: its distortion is taken out, and its size is a statement.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/model/target_grid.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::GiveFloor;
using thicklens::testing::Simulate;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;

SimulatedSweep GridSweepOfCase(double distortion, std::uint64_t seed, double step_mm = 2) {
  model::SweepSimulationOptions options = SweepCase("ii", 0, seed);
  options.bits = 16;
  options.frame_count = 16;
  options.step_mm = step_mm;
  options.first_depth_mm = 300.4 - 7.5 * step_mm;
  options.aberrations.distortion = distortion;
  options.target = {};
  options.target.kind = model::TargetKind::kGrid;
  options.target.grid = model::ParseTargetGrid("charuco:11x9:1");
  SimulatedSweep simulated = Simulate(options);
  GiveFloor(&simulated);
  simulated.sweep.target_grid = options.target.grid;
  return simulated;
}

CalibrationOptions WithoutMap() {
  CalibrationOptions options;
  options.map_field = false;
  return options;
}

double SigmasOutside(const Result& result, double truth) {
  double low = result.value, high = result.value;
  if (result.systematic) {
    low = std::min(low, result.systematic->x());
    high = std::max(high, result.systematic->y());
  }
  return std::max({0.0, low - truth, truth - high}) / result.sigma;
}

TEST(GridSweeps, ADistortionThatTheGridShowsIsTakenOut) {
  const SimulatedSweep s = GridSweepOfCase(-0.06, 1);
  const Calibration found = Calibrate(s.sweep, WithoutMap());
  const GridGeometry& grid = found.diagnostics.grid;
  ASSERT_TRUE(grid.done) << grid.message;
  EXPECT_TRUE(grid.distortion_is_used) << grid.verdict;
  ASSERT_TRUE(found.summary.blur_ratio && found.summary.focus_depth_mm) << found.summary.reason;
  EXPECT_LE(SigmasOutside(*found.summary.blur_ratio, s.truth.blur_ratio), 3);
  EXPECT_LE(SigmasOutside(*found.summary.focus_depth_mm, s.truth.focus_depth_mm), 3);
  EXPECT_THAT(found.summary.warnings, Not(Contains(HasSubstr("distorted images"))));
  EXPECT_THAT(found.summary.warnings, Not(Contains(HasSubstr("the grid puts"))));
  const model::Camera camera = CalibratedCamera(s.sweep.camera, found, false);
  ASSERT_TRUE(camera.distortion);
  EXPECT_TRUE(camera.calibration->evidence.undistorted);
  EXPECT_EQ(camera.distortion->covariance.rows(), 8);

  FocusSweep without = s.sweep;
  without.target_grid.reset();
  const Calibration distorted = Calibrate(without, WithoutMap());
  EXPECT_TRUE(distorted.summary.outcome == Outcome::kRefused ||
              std::any_of(distorted.summary.warnings.begin(), distorted.summary.warnings.end(),
                          [](const std::string& warning) {
                            return warning.find("distorted images") != std::string::npos;
                          }));
}

TEST(GridSweeps, ALensWithoutDistortionGetsNone) {
  SimulatedSweep s = GridSweepOfCase(0, 2);
  s.sweep.stated_focus = {{model::ConjugateKind::kMagnification, {0.25, 0.001}, "magnification"}};
  const Calibration found = Calibrate(s.sweep, WithoutMap());
  ASSERT_TRUE(found.diagnostics.grid.done) << found.diagnostics.grid.message;
  EXPECT_FALSE(found.diagnostics.grid.distortion_is_found) << found.diagnostics.grid.verdict;
  EXPECT_FALSE(CalibratedCamera(s.sweep.camera, found, false).distortion);
  // The true magnification is 50/250.
  EXPECT_THAT(found.summary.warnings, Contains(HasSubstr("by target_grid it is 0.2")));
}

// The image scale of a short sweep hardly determines the depth, but the size of the squares does.
TEST(GridSweeps, TheSizeOfTheSquaresStatesTheMagnification) {
  SimulatedSweep s = GridSweepOfCase(0, 3, 0.5);
  s.sweep.offset_mm.reset();
  const Calibration found = Calibrate(s.sweep, WithoutMap());
  EXPECT_EQ(found.diagnostics.bench_offset_from, "target_grid") << found.summary.reason;
  ASSERT_TRUE(found.summary.focus_depth_mm);
  EXPECT_LE(SigmasOutside(*found.summary.focus_depth_mm, s.truth.focus_depth_mm), 3);
}

TEST(GridSweeps, AMovingLensHasNoGeometry) {
  SimulatedSweep s = GridSweepOfCase(0, 4);
  s.sweep.moves = model::SweepMotion::kSensor;
  const Calibration found = Calibrate(s.sweep, WithoutMap());
  EXPECT_FALSE(found.diagnostics.grid.done);
  EXPECT_THAT(found.summary.warnings, Contains(HasSubstr("the lens or the sensor moves")));
}

}  // namespace
}  // namespace thicklens::calib
