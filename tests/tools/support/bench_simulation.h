#ifndef THICKLENS_TESTS_TOOLS_SUPPORT_BENCH_SIMULATION_H_
#define THICKLENS_TESTS_TOOLS_SUPPORT_BENCH_SIMULATION_H_

#include <cstdint>

#include "thicklens/simulate.h"

namespace thicklens::testing {

// A small sweep of the camera of case ii, which is focused at 300 mm: a thin lens of 50 mm with an
// aperture radius of 8.9286 mm, pixels of 4.5 um, linear values, blur ratio 0.45, floor 0.5 px. It
// takes less than a second to simulate, and it determines the camera.
inline SweepSimulation SmallBenchSimulation(std::uint64_t seed = 1) {
  SweepSimulation simulation =
      ReadSweepSimulation(THICKLENS_SOURCE_DIR "/configs/sweeps/case-ii.yaml");
  model::Sensor& sensor = simulation.camera.sensor;
  sensor.width_px = sensor.height_px = 144;
  sensor.principal_point_px.setConstant(71.5);
  simulation.first_depth_mm = 286;
  simulation.step_mm = 3;
  simulation.frame_count = 10;
  simulation.bench_offset_mm = 20;
  simulation.reading_sigma_mm = 0.05;
  simulation.seed = seed;
  return simulation;
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_TOOLS_SUPPORT_BENCH_SIMULATION_H_
