// Simulated sweeps whose readings are counts of a drive.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <string>

#include "support/temporary_folder.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {
namespace {

using ::testing::HasSubstr;

SweepSimulationOptions OfSensor(double counts_per_mm) {
  SweepSimulationOptions options =
      ReadSweepSimulation(THICKLENS_SOURCE_DIR "/configs/sweeps/case-ii.yaml");
  options.camera.sensor.width_px = options.camera.sensor.height_px = 16;
  options.camera.sensor.principal_point_px = {7.5, 7.5};
  options.moves = SweepMotion::kSensor;
  options.first_image_distance_mm = options.camera.image_distance_mm() - 0.5;
  options.step_mm = 0.04;
  options.frame_count = 25;
  options.bench_offset_mm = 50;
  options.reading_sigma_mm = 0;
  options.stage = {};
  options.counts_per_mm = counts_per_mm;
  return options;
}

// A reading is the whole count that is nearest to the position of the sensor.
TEST(CountedSweep, ReadingsAreWholeCountsFromTheOffset) {
  for (const BenchDirection direction : {BenchDirection::kAway, BenchDirection::kToward}) {
    SweepSimulationOptions options = OfSensor(310);
    options.direction = direction;
    const SweepSimulator simulator(options, {});
    EXPECT_EQ(simulator.truth().counts_per_mm, 310);
    for (const SweepTruth::Frame& frame : simulator.truth().frames) {
      const double counts =
          310 * DirectionSign(direction) * (frame.image_distance_mm - options.bench_offset_mm);
      EXPECT_NEAR(frame.reading_mm, counts, 0.5 + 1e-9);
      EXPECT_EQ(frame.reading_mm, std::round(frame.reading_mm));
    }
  }
}

// The written sweep is read as one of counts, with the readings of its table.
TEST(CountedSweep, IsReadAsItWasWritten) {
  const testing::TemporaryFolder folder;
  SweepFile sweep;
  sweep.camera_path = "camera.yaml";
  sweep.moves = SweepMotion::kLens;
  sweep.readings_are_counts = true;
  sweep.focus_depth_mm = Estimate{300, 0.5};
  for (const int i : {0, 1, 2})
    sweep.frames.push_back({"frames/" + std::to_string(i) + ".png", 100.0 * i - 40});
  for (const SweepFrame& frame : sweep.frames) folder.Put(frame.image, "x");
  folder.Put("readings.csv", ReadingsTable(sweep));
  const SweepFile read = ReadSweep(folder.Put("sweep.yaml", SweepToYaml(sweep)), nullptr);
  EXPECT_TRUE(read.readings_are_counts);
  EXPECT_EQ(read.moves, SweepMotion::kLens);
  ASSERT_EQ(read.frames.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(read.frames[i].reading_mm, sweep.frames[i].reading_mm);
    EXPECT_THAT(read.frames[i].image, HasSubstr(sweep.frames[i].image));
  }
}

}  // namespace
}  // namespace thicklens::model
