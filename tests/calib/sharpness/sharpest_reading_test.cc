#include "calib/sharpness/sharpest_reading.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace thicklens::calib {
namespace {

using ::testing::HasSubstr;

// Sharpness that decreases as the blur grows, with errors. The readings are in random order.
std::vector<FrameMeasurement> Frames(double focus_mm, double first_mm, double step_mm, int count,
                                     double error, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  std::vector<FrameMeasurement> frames(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < frames.size(); ++i) {
    frames[i].reading_mm = first_mm + step_mm * static_cast<double>((7 * i) % frames.size());
    const double blur_px = std::hypot(1, 1.5 * (frames[i].reading_mm - focus_mm));
    frames[i].normalised_edge_slope = 0.3 / blur_px * (1 + error * normal(random));
    frames[i].statistics.mean_linear = 0.5;
    frames[i].statistics.top_gradient = 0.1 / blur_px * (1 + error * normal(random));
  }
  return frames;
}

std::vector<std::size_t> All(const std::vector<FrameMeasurement>& frames) {
  std::vector<std::size_t> used(frames.size());
  for (std::size_t i = 0; i < used.size(); ++i) used[i] = i;
  return used;
}

TEST(SharpestReading, IsThePeakWithAnErrorThatCoversIt) {
  int covered = 0;
  for (unsigned seed = 0; seed < 100; ++seed) {
    const double focus_mm = 110 + 0.01 * seed;
    const auto frames = Frames(focus_mm, 95, 0.25, 121, 0.01, seed);
    const SharpestReading found = FindSharpestReading(frames, All(frames));
    ASSERT_TRUE(found.done) << found.message;
    EXPECT_LT(found.reading_mm.sigma, 0.1);
    covered += std::abs(found.reading_mm.value - focus_mm) < 2 * found.reading_mm.sigma ? 1 : 0;
  }
  EXPECT_GE(covered, 85);
}

TEST(SharpestReading, WhereItRisesToAnEndThereIsNone) {
  for (const double focus_mm : {90.0, 130.0}) {
    const auto frames = Frames(focus_mm, 95, 1, 31, 0.002, 1);
    const SharpestReading found = FindSharpestReading(frames, All(frames));
    EXPECT_FALSE(found.done);
    EXPECT_THAT(found.message, HasSubstr(focus_mm < 95 ? "up to the smallest reading, 95 mm"
                                                       : "up to the largest reading, 125 mm"));
    ASSERT_GE(found.sharpest_frame, 0);
    EXPECT_EQ(frames[static_cast<std::size_t>(found.sharpest_frame)].reading_mm,
              focus_mm < 95 ? 95 : 125);
  }
}

// Two measures of sharpness peak at different readings: behind an aberrated lens neither is right.
TEST(SharpestReading, MeasuresThatDisagreeWidenTheError) {
  auto frames = Frames(110, 95, 0.25, 121, 0.001, 3);
  const double before_mm = FindSharpestReading(frames, All(frames)).reading_mm.sigma;
  for (FrameMeasurement& frame : frames)
    frame.statistics.top_gradient = 0.1 / std::hypot(1, 1.5 * (frame.reading_mm - 110.4));
  const double after_mm = FindSharpestReading(frames, All(frames)).reading_mm.sigma;
  EXPECT_LT(before_mm, 0.05);
  EXPECT_NEAR(after_mm, 0.2, 0.05);
}

TEST(SharpestReading, FourFramesAreTooFew) {
  const auto frames = Frames(110, 108, 1, 4, 0, 1);
  const SharpestReading found = FindSharpestReading(frames, All(frames));
  EXPECT_FALSE(found.done);
  EXPECT_THAT(found.message, HasSubstr("4 of 4 frames passed the checks, but 5 are needed"));
}

// A sweep that was refused because of its light has no frames, which says nothing about edges.
TEST(SharpestReading, SaysWhetherFramesOrEdgesAreMissing) {
  auto frames = Frames(110, 95, 1, 31, 0, 1);
  EXPECT_THAT(FindSharpestReading(frames, {}).message,
              HasSubstr("0 of 31 frames passed the checks"));
  for (std::size_t i = 3; i < frames.size(); ++i) frames[i].normalised_edge_slope = 0;
  EXPECT_THAT(FindSharpestReading(frames, All(frames)).message,
              HasSubstr("3 of 31 frames have edges, but 5 are needed"));
  for (FrameMeasurement& frame : frames) frame.normalised_edge_slope = 0;
  EXPECT_THAT(FindSharpestReading(frames, All(frames)).message, HasSubstr("no edges were measured"))
      << "a sweep that is refused before that";
}

}  // namespace
}  // namespace thicklens::calib
