#ifndef THICKLENS_TESTS_CALIB_ACCURACY_BENCH_H_
#define THICKLENS_TESTS_CALIB_ACCURACY_BENCH_H_

#include <cstdint>

#include "tests/calib/simulated_sweep.h"

namespace thicklens::testing {

// The base of configs/accuracy/benches.yaml, to which its kinds add their keys.
inline model::SweepSimulationOptions AccuracyBench(std::uint64_t seed) {
  model::SweepSimulationOptions options = SweepCase("ii", 0, seed);
  options.camera.sensor.width_px = 320;
  options.camera.sensor.height_px = 240;
  options.camera.sensor.principal_point_px = {159.5, 119.5};
  options.bits = 16;
  return options;
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_ACCURACY_BENCH_H_
