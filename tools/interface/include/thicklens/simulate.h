#ifndef THICKLENS_SIMULATE_H_
#define THICKLENS_SIMULATE_H_

#include <cstddef>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/base/output_file.h"
#include "thicklens/camera.h"
#include "thicklens/depth.h"
#include "thicklens/effects.h"
#include "thicklens/image.h"
#include "thicklens/light_field.h"
#include "thicklens/model/scene_simulator.h"
#include "thicklens/model/sweep_simulator.h"
#include "thicklens/run.h"
#include "thicklens/sweep.h"

namespace thicklens {

// What is simulated; the members, units and defaults are those of the model's simulators.
using SweepSimulation = model::SweepSimulationOptions;
using SceneSimulation = model::SceneSimulationOptions;

// Read files of the schemas thicklens/simulate-sweep/1 and thicklens/simulate-scene/1. They throw
// Error with file:line:column.
THICKLENS_EXPORT SweepSimulation ReadSweepSimulation(const std::string& path);
THICKLENS_EXPORT SceneSimulation ReadSceneSimulation(const std::string& path);

// Simulates a focus sweep and writes it into a folder: frames/, camera.yaml (without calibration),
// sweep.yaml and truth.yaml, completely or not at all. `unknown_offset`: leave the bench offset out
// of sweep.yaml. Returns the sweep as ReadSweep would, with its truth. The simulation's seed
// determines every bit. Throws Error for options that are not valid.
THICKLENS_EXPORT Sweep SimulateSweep(const SweepSimulation& simulation, const std::string& folder,
                                     bool unknown_offset = false, const RunControl& run = {});

// Both steps of it, for a folder that is claimed before a long computation or that gets other files
// too: the name is claimed, the frames are written below it as they are rendered and the
// descriptions after them, and Commit of the folder (thicklens/base/output_file.h) puts it in
// place.
struct SimulatedSweep {
  model::SweepTruth truth;
  model::EffectSelection effects;
  int bits = 0;  // of the frames' values
};
THICKLENS_EXPORT OutputFolder ClaimSweepFolder(const std::string& folder);
THICKLENS_EXPORT SimulatedSweep SimulateSweep(const SweepSimulation& simulation,
                                              OutputFolder* folder, bool unknown_offset = false,
                                              const RunControl& run = {});

// A simulated photograph with its depth (kZ, mm from Ap), camera and truth.
struct SimulatedPhotograph {
  Image photo;  // encoded
  DepthMap depth;
  Camera camera;  // with the true calibration
  model::SceneTruth truth;
  model::EffectSelection effects;
  // Largest rms error of the encoded values by the finite number of rays, in 1/255 of full scale.
  double sampling_error_grey_levels = 0;
  double mean_rays_per_pixel = 0;
};
THICKLENS_EXPORT SimulatedPhotograph SimulatePhotograph(const SceneSimulation& simulation,
                                                        const RunControl& run = {});
// The true light field of the same scene: its views have no defocus and no fall-off. `scene`, if
// not null, gets what is true of the scene.
struct SimulatedScene {
  model::SceneTruth truth;
  EffectSet effects_of_views;
};
THICKLENS_EXPORT LightField SimulateLightField(const SceneSimulation& simulation,
                                               const RunControl& run = {},
                                               SimulatedScene* scene = nullptr);

}  // namespace thicklens

#endif  // THICKLENS_SIMULATE_H_
