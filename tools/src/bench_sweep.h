#ifndef THICKLENS_TOOLS_BENCH_SWEEP_H_
#define THICKLENS_TOOLS_BENCH_SWEEP_H_

#include <cstdint>

#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::tools {

// A simulated focus sweep in memory, as a calibration gets it, with its truth beside.
struct BenchSweep {
  calib::FocusSweep sweep;  // of all frames; without calibration, the bench zero given
  model::SweepTruth truth;
  double frames_phase = 0;  // 0 to 1: which frames are taken where not all are
};

// The sweep that is measured where none is given: 50 mm at f/2.8 focused at 300 mm, 31 frames 1 mm
// apart before dead leaves, 20 px of blur radius at its ends, with noise and reading errors.
model::SweepSimulationOptions BenchSweepOptions();

// One of the sweeps that a description stands for, on the middle field_px x field_px px of its
// sensor. Beside texture and noise the seed draws
//  - where the plane of focus lies between two frames: else a method that names a frame would be
//    always right or always wrong,
//  - the error of what is stated of the lens floor (not for a knife edge, which shows it), because
//  a
//    floor that is stated with an error and given without one makes the results' errors look too
//    large.
BenchSweep MakeBenchSweep(const model::SweepSimulationOptions& description,
                          const model::LinearPicture& target_picture, int field_px,
                          std::uint64_t seed);

// The same photographs, of which so many are used, evenly spread, and that much of their middle.
calib::FocusSweep PartOfSweep(const BenchSweep& bench, int frames, int field_px);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_SWEEP_H_
