#ifndef THICKLENS_TOOLS_HARD_SWEEPS_H_
#define THICKLENS_TOOLS_HARD_SWEEPS_H_

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "hard_case.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/sweep_file.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::tools {

// A simulated sweep, and what is done to it before it is calibrated.
struct HardSweep {
  model::SweepSimulationOptions simulation = UsualSimulation();
  std::function<void(std::vector<model::StoredPicture>*)> damage;  // of the frames
  std::function<void(model::SweepFile*)> describe;                 // of what is said about them
  std::function<void(model::Camera*)> change_camera;

  // 50 mm at f/2.8 focused at 300 mm, 31 frames of 192 x 192 px, 1 mm apart, dead leaves, 8 bits.
  static model::SweepSimulationOptions UsualSimulation();
};

// Writes sweep/ with its frames and sweep.yaml, the lens floor and the bench zero given.
model::SweepTruth WriteSweep(const std::filesystem::path& folder, const HardSweep& sweep);

// `calibrate` of it into camera.yaml.
HardRun CalibrationOf(Requirement required);

// The largest error of d1, zf and kappa, in standard errors beyond the systematic interval. Throws
// Error where d1 is off by more than so many um whatever its error says.
Requirement FindsTruth(const model::SweepTruth& truth, double most_um);

// What a sweep alone cannot show to be wrong, but looks wrong: done, and a warning holds the words.
Requirement Warned(const std::vector<std::string>& words);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_HARD_SWEEPS_H_
