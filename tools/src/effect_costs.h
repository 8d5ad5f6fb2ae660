#ifndef THICKLENS_TOOLS_EFFECT_COSTS_H_
#define THICKLENS_TOOLS_EFFECT_COSTS_H_

#include <functional>
#include <utility>
#include <vector>

#include "explain_table.h"
#include "thicklens/model/effect_choice.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::tools {

// What effects cost in a simulated picture of a camera, measured on this machine.
struct EffectCosts {
  double seconds = 0;  // of the picture with the effects that are on, of one core
  // Of each effect that a picture of a scene can have: how much longer the picture takes with it
  // than without it, all others being as they are. 0: nothing of it is there, or less than can be
  // measured.
  std::vector<std::pair<model::Effect, double>> of_effect;
};

// Simulates a patch of the middle of the sensor, whose left half shows leaves in the nearest depth
// and whose right half leaves in the farthest (at most 1 km), several times, and takes medians; the
// picture is as many patches as it has pixels for. `sensor`: its noise and bits; its camera, layers
// and effects do not count. `tell` is called before each of them, and may throw to stop.
// Throws Error for a camera or depths that cannot be simulated.
EffectCosts MeasureEffectCosts(const model::Camera& camera, const DepthRange& range,
                               const model::SceneSimulationOptions& sensor,
                               const model::EffectDecision& decision,
                               const std::function<void(int done, int total)>& tell);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_EFFECT_COSTS_H_
