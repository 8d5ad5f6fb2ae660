#ifndef THICKLENS_SIMULATE_H_
#define THICKLENS_SIMULATE_H_

#include <cstddef>
#include <string>
#include <vector>

#include "thicklens/camera.h"
#include "thicklens/depth.h"
#include "thicklens/export.h"
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

// A simulated photograph with its depth (kZ, mm from Ap), camera and truth.
struct SimulatedPhotograph {
  Image photo;  // encoded
  DepthMap depth;
  Camera camera;  // with the true calibration
  model::SceneTruth truth;
  model::EffectSelection effects;
};
THICKLENS_EXPORT SimulatedPhotograph SimulatePhotograph(const SceneSimulation& simulation,
                                                        const RunControl& run = {});
// The true light field of the same scene: its views have no defocus and no fall-off.
THICKLENS_EXPORT LightField SimulateLightField(const SceneSimulation& simulation,
                                               const RunControl& run = {});

}  // namespace thicklens

#endif  // THICKLENS_SIMULATE_H_
