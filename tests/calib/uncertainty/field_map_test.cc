// The map over the field is compared with targets that are composed of sweeps at known depths.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using thicklens::testing::GiveFloor;
using thicklens::testing::Simulate;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;

constexpr int kSizePx = 256;

// Case iii with the target `farther_mm` beyond its stated position.
SimulatedSweep SweepAt(double farther_mm, double focus_shift_mm = 0) {
  model::SweepSimulationOptions options = SweepCase("iii", kSizePx, 3);
  options.target.kind = model::TargetKind::kWhiteNoise;
  options.first_depth_mm += farther_mm + focus_shift_mm;
  options.bench_offset_mm += farther_mm + focus_shift_mm;
  options.lamp_falloff = false;
  SimulatedSweep s = Simulate(options);
  s.sweep.offset_mm = model::Estimate{s.sweep.offset_mm->value - farther_mm - focus_shift_mm, 0};
  GiveFloor(&s);
  return s;
}

// Each part of the field is from a sweep of its own; `depth_at` returns how much farther the target
// is at a column.
template <typename DepthAt>
SimulatedSweep InStrips(int strips, const DepthAt& depth_at) {
  SimulatedSweep whole = SweepAt(0);
  const int width = kSizePx / strips;
  for (int k = 0; k < strips; ++k) {
    const SimulatedSweep part = SweepAt(depth_at((k + 0.5) * width - 0.5 * kSizePx));
    const cv::Rect strip(k * width, 0, width, kSizePx);
    for (std::size_t i = 0; i < part.stored->size(); ++i)
      (*part.stored)[i](strip).copyTo((*whole.stored)[i](strip));
  }
  return whole;
}

TEST(FieldMap, AFlatTargetHasOneDepthAndNoTilt) {
  const SimulatedSweep s = SweepAt(0);
  const Calibration c = Calibrate(s.sweep, {});
  ASSERT_TRUE(c.diagnostics.field.done) << c.diagnostics.field.message << c.summary.reason;
  EXPECT_EQ(c.diagnostics.field.clusters.size(), 1U);
  EXPECT_EQ(c.diagnostics.field.tiles.size(), 25U);
  EXPECT_NEAR(c.diagnostics.field.tilt_right_deg->value, 0,
              4 * c.diagnostics.field.tilt_right_deg->sigma);
  EXPECT_NEAR(c.diagnostics.field.tilt_down_deg->value, 0,
              4 * c.diagnostics.field.tilt_down_deg->sigma);
  EXPECT_LT(c.diagnostics.field.tilt_right_deg->sigma, 1);
  EXPECT_NEAR(c.diagnostics.field.curvature_mm->value, 0,
              4 * c.diagnostics.field.curvature_mm->sigma);
  EXPECT_NEAR(c.diagnostics.field.astigmatism_mm->value, 0,
              4 * c.diagnostics.field.astigmatism_mm->sigma);
  for (const FieldTile& tile : c.diagnostics.field.tiles) {
    ASSERT_TRUE(tile.done) << tile.message;
    EXPECT_NEAR(tile.focus_depth_mm.value, s.truth.focus_depth_mm, 1);
  }
  EXPECT_TRUE(c.diagnostics.channels.empty());  // grey frames
}

TEST(FieldMap, IsLeftOutOnRequest) {
  CalibrationOptions options;
  options.map_field = false;
  const Calibration c = Calibrate(SweepAt(0).sweep, options);
  EXPECT_TRUE(c.summary.focus_depth_mm);
  EXPECT_FALSE(c.diagnostics.field.done);
  EXPECT_TRUE(c.diagnostics.field.tiles.empty());
}

TEST(FieldMap, SlowATiltIsMeasuredInDegrees) {
  constexpr double kTiltDeg = 8;
  const double mm_per_px = 400 * 0.006 / (12.5 * 400 / (400 - 12.5));
  // Positive means that the right side is nearer.
  const SimulatedSweep s = InStrips(
      16, [&](double x_px) { return -x_px * mm_per_px * std::tan(kTiltDeg * CV_PI / 180); });
  const Calibration c = Calibrate(s.sweep, {});
  ASSERT_TRUE(c.diagnostics.field.done) << c.diagnostics.field.message << c.summary.reason;
  EXPECT_NEAR(c.diagnostics.field.tilt_right_deg->value, kTiltDeg, 1);
  EXPECT_NEAR(c.diagnostics.field.tilt_down_deg->value, 0, 1);
  EXPECT_EQ(c.diagnostics.field.clusters.size(), 1U);
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("tilted")));
}

// The target is simulated with a tilt, for a lens whose focus determines depths well. The result
// agrees within the stated error of the map.
TEST(FieldMap, FindsTheTiltThatWasSimulated) {
  for (const double tilt_deg : {1.0, -2.0}) {
    SCOPED_TRACE(tilt_deg);
    model::SweepSimulationOptions options =
        model::ReadSweepSimulation(THICKLENS_SOURCE_DIR "/configs/sweeps/demo.yaml");
    options.target.tilt_deg = tilt_deg;
    SimulatedSweep s = Simulate(options);
    GiveFloor(&s);
    const Calibration c = Calibrate(s.sweep, {});
    ASSERT_TRUE(c.diagnostics.field.done) << c.diagnostics.field.message << c.summary.reason;
    EXPECT_LT(c.diagnostics.field.tilt_right_deg->sigma, 0.05);
    EXPECT_NEAR(c.diagnostics.field.tilt_right_deg->value, tilt_deg,
                3.5 * c.diagnostics.field.tilt_right_deg->sigma);
    EXPECT_NEAR(c.diagnostics.field.tilt_down_deg->value, 0,
                3.5 * c.diagnostics.field.tilt_down_deg->sigma);
    EXPECT_NEAR(c.summary.focus_depth_mm->value, s.truth.focus_depth_mm,
                4 * c.summary.focus_depth_mm->sigma);
  }
}

TEST(FieldMap, SlowALongSweepIsMappedFromAPartOfItsFrames) {
  model::SweepSimulationOptions options = SweepCase("iii", 192, 3);
  options.target.kind = model::TargetKind::kWhiteNoise;
  options.step_mm *= static_cast<double>(options.frame_count) / 150;
  options.frame_count = 150;
  SimulatedSweep s = Simulate(options);
  GiveFloor(&s);
  const Calibration c = Calibrate(s.sweep, {});
  ASSERT_TRUE(c.diagnostics.field.done) << c.diagnostics.field.message << c.summary.reason;
  EXPECT_NEAR(c.diagnostics.field.tilt_right_deg->value, 0,
              4 * c.diagnostics.field.tilt_right_deg->sigma);
  for (const FieldTile& tile : c.diagnostics.field.tiles) {
    ASSERT_TRUE(tile.done) << tile.message;
    EXPECT_NEAR(tile.focus_depth_mm.value, s.truth.focus_depth_mm, 1);
  }
}

TEST(FieldMap, DepthsOfATargetInStepsAreParted) {
  constexpr double kStepMm = 12;
  const SimulatedSweep s = InStrips(2, [](double x_px) { return x_px < 0 ? 0.0 : kStepMm; });
  const Calibration c = Calibrate(s.sweep, {});
  ASSERT_TRUE(c.diagnostics.field.done) << c.diagnostics.field.message << c.summary.reason;
  ASSERT_GE(c.diagnostics.field.clusters.size(), 2U);
  EXPECT_THAT(c.summary.warnings, Contains(HasSubstr("not at one depth")));
  // A part that is farther than its reading states is in focus at a smaller reading.
  const double truth = s.truth.focus_depth_mm;
  EXPECT_NEAR(c.diagnostics.field.clusters.front().focus_depth_mm.value, truth - kStepMm, 1.5);
  EXPECT_NEAR(c.diagnostics.field.clusters.back().focus_depth_mm.value, truth, 1.5);
  // Both values are in the interval.
  ASSERT_TRUE(c.summary.focus_depth_mm->systematic);
  EXPECT_LT(c.summary.focus_depth_mm->systematic->x(), truth - kStepMm + 1.5);
  EXPECT_GT(c.summary.focus_depth_mm->systematic->y(), truth - 1.5);
}

TEST(FieldMap, EachColourHasItsOwnFocus) {
  // Red, green and blue are in focus at readings 3 mm apart.
  const double shifts_mm[] = {-3, 0, 3};
  SimulatedSweep s = SweepAt(0);
  std::vector<SimulatedSweep> colours;
  for (const double shift : shifts_mm) colours.push_back(SweepAt(shift));
  for (std::size_t i = 0; i < s.stored->size(); ++i) {
    const std::vector<cv::Mat> channels = {(*colours[0].stored)[i], (*colours[1].stored)[i],
                                           (*colours[2].stored)[i]};
    cv::Mat image;
    cv::merge(channels, image);
    (*s.stored)[i] = image;
  }
  const Calibration c = Calibrate(s.sweep, {});
  ASSERT_EQ(c.diagnostics.channels.size(), 3U) << c.summary.reason;
  const char* const names[] = {"red", "green", "blue"};
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(c.diagnostics.channels[k].name, names[k]);
    ASSERT_TRUE(c.diagnostics.channels[k].done) << c.diagnostics.channels[k].message;
    EXPECT_NEAR(c.diagnostics.channels[k].focus_depth_mm.value,
                s.truth.focus_depth_mm - shifts_mm[k], 0.5);
  }
}

}  // namespace
}  // namespace thicklens::calib
