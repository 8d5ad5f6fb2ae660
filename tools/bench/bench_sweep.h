#ifndef THICKLENS_TOOLS_BENCH_BENCH_SWEEP_H_
#define THICKLENS_TOOLS_BENCH_BENCH_SWEEP_H_

#include <cstdint>

#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::tools {

// A simulated focus sweep in memory, as a calibration gets it, with its truth.
struct BenchSweep {
  calib::FocusSweep sweep;  // all frames; without calibration, with the bench offset
  model::SweepTruth truth;
  double frames_phase = 0;  // 0 to 1: selects the frames if not all are used
};

// The default sweep of the bench: 50 mm at f/2.8 focused at 300 mm, 31 frames 1 mm apart in front
// of dead leaves, 20 px of blur radius at its ends, with noise and reading errors.
model::SweepSimulationOptions BenchSweepOptions();

// Makes one of the sweeps that a description represents, on the middle field_px x field_px px of
// its sensor. Besides texture and noise the seed draws
// - the position of the plane of focus between two frames: otherwise a method that names a frame
//   would be always right or always wrong,
// - the error of the stated blur floor (not for a knife edge, which shows the floor), because a
//   floor that has an error but is stated without one makes the errors of the results look too
//   large.
BenchSweep MakeBenchSweep(const model::SweepSimulationOptions& description,
                          const model::LinearImage& target_image, int field_px, std::uint64_t seed);

// Returns `frames` of the same photographs, evenly spread, and field_px x field_px px of their
// middle.
calib::FocusSweep PartOfSweep(const BenchSweep& bench, int frames, int field_px);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_SWEEP_H_
