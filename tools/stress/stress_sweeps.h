#ifndef THICKLENS_TOOLS_STRESS_STRESS_SWEEPS_H_
#define THICKLENS_TOOLS_STRESS_STRESS_SWEEPS_H_

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "thicklens/model/scene.h"
#include "thicklens/model/sweep_file.h"
#include "thicklens/model/sweep_simulator.h"
#include "tools/stress/stress_case.h"

namespace thicklens::tools {

// A simulated sweep, and its changes before it is calibrated.
struct StressSweep {
  model::SweepSimulationOptions simulation = UsualSimulation();
  std::function<void(std::vector<model::EncodedImage>*)> damage;  // changes the frames
  std::function<void(model::SweepFile*)> describe;                // changes their description
  std::function<void(model::Camera*)> change_camera;

  // 50 mm at f/2.8 focused at 300 mm, 31 frames of 192 x 192 px, 1 mm apart, dead leaves, 8 bits.
  static model::SweepSimulationOptions UsualSimulation();
};

// Writes sweep/ with its frames and sweep.yaml; the blur floor and the bench offset are given.
model::SweepTruth WriteSweep(const std::filesystem::path& folder, const StressSweep& sweep);

// Returns the run of `calibrate` on this sweep, with the output camera.yaml.
StressRun CalibrationOf(Requirement required);

// Requires a limit on the largest error of d1, zf and kappa, in standard errors beyond the
// systematic interval. Throws Error if d1 is off by more than `most_um` um, whatever its stated
// error is.
Requirement FindsTruth(const model::SweepTruth& truth, double most_um);

// Requires a solved run whose warning contains the words: for a sweep that looks wrong, but cannot
// be proved wrong.
Requirement Warned(const std::vector<std::string>& words);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_STRESS_STRESS_SWEEPS_H_
