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

// The settings of simulations; the members, units and defaults are those of the model's simulators.
using SweepSimulation = model::SweepSimulationOptions;
// A scene of textured surfaces, and the camera that photographs it.
using SceneSimulation = model::SceneSimulationOptions;

// Read files of the schemas thicklens/simulate-sweep/1 and thicklens/simulate-scene/1. They throw
// Error with file:line:column.
THICKLENS_EXPORT SweepSimulation ReadSweepSimulation(const std::string& path);
// Reads a file of the schema thicklens/simulate-scene/1. Throws Error with file:line:column.
THICKLENS_EXPORT SceneSimulation ReadSceneSimulation(const std::string& path);

// Simulates a focus sweep and writes it into a folder: frames/, camera.yaml (without calibration),
// sweep.yaml and truth.yaml, completely or not at all. `unknown_offset`: leave the bench offset out
// of sweep.yaml. Returns the sweep as ReadSweep would, with its truth. The simulation's seed
// determines every bit. Throws Error for options that are not valid.
THICKLENS_EXPORT Sweep SimulateSweep(const SweepSimulation& simulation, const std::string& folder,
                                     bool unknown_offset = false, const RunControl& run = {});

// The result of simulating a sweep.
struct SimulatedSweep {
  model::SweepTruth truth;         // parameters, and depth and blur of each frame
  model::EffectSelection effects;  // the effects that the frames have
  int bits = 0;                    // of the frames' values
};
// The files that `thicklens simulate --ablate` adds to a simulated folder: a page and a table. A
// run without an ablation replaces them too.
inline constexpr char kAblationPage[] = "attribution.html";
// The table of an ablation.
inline constexpr char kAblationTable[] = "attribution.csv";
// The first step of SimulateSweep, for a folder that is claimed before a long computation or that
// gets other files too. The frames are then written below it as they are rendered and the
// descriptions after them, and Commit of the folder (thicklens/base/output_file.h) puts it in
// place. Throws Error if the folder cannot be written or holds what this program did not write.
THICKLENS_EXPORT OutputFolder ClaimSweepFolder(const std::string& folder);
// Writes frames and descriptions into a claimed folder; the caller commits it. Throws Error for
// options that are not valid and for a folder that is null.
THICKLENS_EXPORT SimulatedSweep SimulateSweep(const SweepSimulation& simulation,
                                              OutputFolder* folder, bool unknown_offset = false,
                                              const RunControl& run = {});

// A simulated photograph with its depth (kZ, mm from Ap), camera and truth.
struct SimulatedPhotograph {
  Image photo;                     // encoded
  DepthMap depth;                  // kZ, mm from Ap
  Camera camera;                   // with the true calibration
  model::SceneTruth truth;         // parameters of the scene
  model::EffectSelection effects;  // the effects that the photograph has
  // Largest rms error of the encoded values by the finite number of rays, in 1/255 of full scale.
  double sampling_error_grey_levels = 0;
  double mean_rays_per_pixel = 0;  // number of simulated rays
};
// Simulates the photograph of a scene. The simulation's seed determines every bit. Throws Error for
// options that are not valid, and Interrupted.
THICKLENS_EXPORT SimulatedPhotograph SimulatePhotograph(const SceneSimulation& simulation,
                                                        const RunControl& run = {});
// The true values of a scene whose views were simulated.
struct SimulatedScene {
  model::SceneTruth truth;     // parameters of the scene
  EffectSet effects_of_views;  // the effects that the views have
};
// Simulates the true light field of a scene: its views have no defocus and no fall-off. `scene` may
// be null. Throws Error for options that are not valid, and Interrupted.
THICKLENS_EXPORT LightField SimulateLightField(const SceneSimulation& simulation,
                                               const RunControl& run = {},
                                               SimulatedScene* scene = nullptr);

}  // namespace thicklens

#endif  // THICKLENS_SIMULATE_H_
