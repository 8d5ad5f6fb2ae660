// A sweep whose frames arrive one after the other.
#include "thicklens/calib/sweep_progress.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "support/error_message.h"
#include "tests/calib/simulated_sweep.h"
#include "thicklens/base/error.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::calib {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using thicklens::testing::ErrorOf;
using thicklens::testing::Simulate;
using thicklens::testing::SimulatedSweep;
using thicklens::testing::SweepCase;

// 31 frames of 1 mm about a plane of focus at 300 mm, 160 px.
SimulatedSweep Usual() {
  model::SweepSimulationOptions options = SweepCase("ii", 160, 4);
  options.frame_count = 31;
  options.step_mm = 1;
  options.first_depth_mm = 285.4;
  options.bench_offset_mm = 200;
  return Simulate(options);
}

SweepProgress WithFrames(const SimulatedSweep& s, const std::vector<std::size_t>& frames) {
  SweepProgress progress(s.sweep, {});
  for (const std::size_t i : frames) progress.Add(s.sweep.frames[i], (*s.stored)[i]);
  return progress;
}

std::vector<std::size_t> Range(std::size_t first, std::size_t last) {
  std::vector<std::size_t> frames(last - first);
  std::iota(frames.begin(), frames.end(), first);
  return frames;
}

TEST(SweepProgress, FindsTheFocusInAnyOrder) {
  const SimulatedSweep s = Usual();
  std::vector<std::size_t> order = Range(0, 31);
  const SweepProgressReport straight = WithFrames(s, order).Report();
  std::shuffle(order.begin(), order.end(), std::mt19937(3));
  const SweepProgressReport shuffled = WithFrames(s, order).Report();
  ASSERT_TRUE(straight.sharpest.done) << straight.sharpest.message;
  ASSERT_TRUE(shuffled.sharpest.done) << shuffled.sharpest.message;
  const double truth_mm = s.truth.focus_depth_mm - s.truth.bench_offset_mm;
  EXPECT_NEAR(straight.sharpest.reading_mm.value, truth_mm,
              4 * straight.sharpest.reading_mm.sigma + 0.3);
  EXPECT_NEAR(shuffled.sharpest.reading_mm.value, straight.sharpest.reading_mm.value, 1e-9);
  EXPECT_EQ(straight.usable, 31);
  EXPECT_EQ(straight.below_focus + straight.above_focus, 31);
  EXPECT_EQ(straight.missing, shuffled.missing);
}

// The sharpness is that of calibrate but for its threshold, which lies on a grid.
TEST(SweepProgress, MeasuresTheSharpnessThatCalibrateMeasures) {
  const SimulatedSweep s = Usual();
  CalibrationOptions options;
  options.fit_blur = false;
  const Calibration c = Calibrate(s.sweep, options);
  const SweepProgressReport report = WithFrames(s, Range(0, 31)).Report();
  int compared = 0;
  for (std::size_t i = 0; i < report.frames.size(); ++i) {
    if (!(c.frames[i].normalised_edge_slope > 0)) continue;  // blurred beyond the threshold
    ++compared;
    EXPECT_NEAR(report.frames[i].sharpness / c.frames[i].normalised_edge_slope, 1, 0.1) << i;
  }
  EXPECT_GT(compared, 15);
}

TEST(SweepProgress, SaysWhatIsMissing) {
  const SimulatedSweep s = Usual();
  const auto missing = [&s](std::size_t first, std::size_t last) {
    return WithFrames(s, Range(first, last)).Report().missing;
  };
  EXPECT_THAT(missing(0, 3),
              ElementsAre("3 usable frames with different readings, but at least 5 are needed"));
  EXPECT_THAT(missing(0, 9), Contains(HasSubstr("no frame is beyond the focus yet: the sharpness "
                                                "rises up to reading 93.")));
  // Focus is between the frames 14 and 15.
  EXPECT_THAT(missing(0, 17), Contains(HasSubstr("the far side of the focus has 2 frames")));
  EXPECT_THAT(missing(13, 31), Contains(HasSubstr("the near side of the focus has 2 frames")));
}

// The number of frames that is asked for reaches the wanted error, and not much more, in the
// measure of the report itself.
TEST(SweepProgress, AsksForNoMoreFramesThanAreNeeded) {
  model::SweepSimulationOptions wide = SweepCase("ii", 160, 4);
  wide.frame_count = 60;
  wide.step_mm = 1;
  wide.first_depth_mm = 285.4;
  const SimulatedSweep s = Simulate(wide);
  SweepProgressOptions options;
  const auto report_of = [&](std::size_t count) {
    SweepProgress progress(s.sweep, options);
    for (std::size_t i = 0; i < count; ++i) progress.Add(s.sweep.frames[i], (*s.stored)[i]);
    return progress.Report();
  };
  const SweepProgressReport first = report_of(18);
  ASSERT_TRUE(first.blur_ratio_error);
  options.wanted_blur_ratio_error = 0.8 * *first.blur_ratio_error;
  const SweepProgressReport before = report_of(18);
  ASSERT_EQ(before.missing.size(), 1U) << before.missing.back();
  const std::string& text = before.missing.front();
  const std::size_t at = text.find("; ");
  ASSERT_NE(text.find(" more beyond reading "), std::string::npos) << text;
  const int more = std::stoi(text.substr(at + 2));
  ASSERT_GE(more, 1);
  ASSERT_LE(18 + more, 60);
  const SweepProgressReport after = report_of(18 + static_cast<std::size_t>(more));
  ASSERT_TRUE(after.blur_ratio_error);
  // Noise and contrast are measured again with the new frames.
  EXPECT_LT(*after.blur_ratio_error, 1.1 * options.wanted_blur_ratio_error);
  EXPECT_GT(*after.blur_ratio_error, 0.8 * options.wanted_blur_ratio_error);
}

// A prediction is of a part of a large region, and says so.
TEST(SweepProgress, SaysAtMostWhereTheRegionIsLarger) {
  model::SweepSimulationOptions wide = SweepCase("ii", 160, 4);
  wide.camera.sensor.width_px = 500;
  wide.camera.sensor.height_px = 80;
  wide.camera.sensor.principal_point_px = {249.5, 39.5};
  wide.frame_count = 20;
  wide.step_mm = 1.5;
  wide.first_depth_mm = 285.4;
  wide.bench_offset_mm = 200;
  SimulatedSweep s = Simulate(wide);
  SweepProgressOptions options;
  options.wanted_blur_ratio_error = 1e-6;
  const auto report_of = [&] {
    SweepProgress progress(s.sweep, options);
    for (std::size_t i = 0; i < s.sweep.frames.size(); ++i)
      progress.Add(s.sweep.frames[i], (*s.stored)[i]);
    return progress.Report();
  };
  const SweepProgressReport large = report_of();
  ASSERT_TRUE(large.blur_ratio_error);
  EXPECT_TRUE(large.is_error_at_most);
  EXPECT_THAT(large.missing, Contains(HasSubstr("kappa is expected to at most ")));
  // A region that is no larger has an error of its own, which is not that of the sensor.
  s.sweep.roi = {200, 0, 100, 80};
  const SweepProgressReport small = report_of();
  ASSERT_TRUE(small.blur_ratio_error);
  EXPECT_FALSE(small.is_error_at_most);
  EXPECT_GT(*small.blur_ratio_error, 1.05 * *large.blur_ratio_error);
  EXPECT_THAT(small.missing, Not(Contains(HasSubstr("at most"))));
}

TEST(SweepProgress, HasTheUnitOfTheReadings) {
  SimulatedSweep s = Usual();
  EXPECT_THAT(WithFrames(s, Range(0, 9)).Report().missing, Contains(HasSubstr(" mm; take")));
  s.sweep.readings_are_counts = true;
  const SweepProgressReport report = WithFrames(s, Range(0, 9)).Report();
  EXPECT_TRUE(report.readings_are_counts);
  EXPECT_THAT(report.missing, Contains(HasSubstr(" steps; take")));
}

TEST(SweepProgress, RejectsAsCalibrateDoes) {
  SimulatedSweep s = Usual();
  s.frame(7).setTo(0);
  s.frame(20).setTo(255);
  const SweepProgressReport report = WithFrames(s, Range(0, 31)).Report();
  EXPECT_EQ(report.rejected, 2);
  EXPECT_THAT(report.frames[7].rejection, HasSubstr("dark"));
  EXPECT_THAT(report.frames[20].rejection, HasSubstr("saturated"));
}

// Points on a black ground are dark frames of a texture, and lose their contrast sooner.
TEST(SweepProgress, ChecksPointsAsCalibrateDoes) {
  model::SweepSimulationOptions options = SweepCase("ii", 160, 4);
  options.target.kind = model::TargetKind::kPinholes;
  options.target.contrast = 0.95;
  options.target.feature_size_mm = 0.12;
  options.target.spacing_mm = 0.9;
  options.light_level = 0.04;
  options.bits = 16;
  options.frame_count = 21;
  options.step_mm = 1;
  options.first_depth_mm = 290.4;
  SimulatedSweep s = Simulate(options);
  s.sweep.target = model::SweepTarget::kPoints;
  CalibrationOptions calibrate;
  calibrate.fit_blur = false;
  const Calibration c = Calibrate(s.sweep, calibrate);
  const SweepProgressReport report = WithFrames(s, Range(0, 21)).Report();
  ASSERT_EQ(c.frames.size(), report.frames.size());
  for (std::size_t i = 0; i < report.frames.size(); ++i)
    EXPECT_EQ(report.frames[i].rejection, c.frames[i].rejection) << i;
  EXPECT_EQ(report.rejected, 0);
  // These frames would not pass as those of a texture.
  s.sweep.target = model::SweepTarget::kTexture;
  EXPECT_GT(WithFrames(s, Range(0, 21)).Report().rejected, 0);
}

// A frame that does not fit is not added.
TEST(SweepProgress, RefusesAFrameOfAnotherSize) {
  const SimulatedSweep s = Usual();
  SweepProgress progress(s.sweep, {});
  progress.Add(s.sweep.frames[0], (*s.stored)[0]);
  EXPECT_THAT(ErrorOf([&] { progress.Add(s.sweep.frames[1], cv::Mat(8, 8, CV_8U)); }),
              HasSubstr("frame-1"));
  EXPECT_EQ(progress.size(), 1U);
  progress.Add(s.sweep.frames[1], (*s.stored)[1]);
  EXPECT_EQ(progress.Report().frames[1].image, "frame-1");
}

TEST(SweepProgress, TakesACorrectedReading) {
  const SimulatedSweep s = Usual();
  SweepProgress progress = WithFrames(s, Range(0, 31));
  const double before_mm = progress.Report().sharpest.reading_mm.value;
  for (std::size_t i = 0; i < 31; ++i) progress.SetReading(i, s.sweep.frames[i].reading_mm + 10);
  EXPECT_NEAR(progress.Report().sharpest.reading_mm.value, before_mm + 10, 1e-6);
  EXPECT_THAT(ErrorOf([&] { progress.SetReading(31, 0); }), HasSubstr("31"));
}

TEST(SweepProgress, RefusesImpossibleOptions) {
  SweepProgressOptions options;
  options.wanted_blur_ratio_error = 0;
  EXPECT_THAT(ErrorOf([&] { SweepProgress(Usual().sweep, options); }),
              HasSubstr("wanted_blur_ratio_error is 0"));
}

}  // namespace
}  // namespace thicklens::calib
