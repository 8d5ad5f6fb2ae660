#ifndef THICKLENS_MODEL_EFFECT_COSTS_H_
#define THICKLENS_MODEL_EFFECT_COSTS_H_

#include <functional>
#include <utility>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/effect_selection.h"
#include "thicklens/model/explanation.h"
#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {

// Cost of effects in a simulated image of a camera, measured on this machine.
struct EffectCosts {
  double seconds = 0;  // time of the image with the enabled effects, on one core
  // For each effect that an image of a scene can have: the additional time of the image with the
  // effect, all others unchanged. 0: the effect does not occur, or its cost is too small to
  // measure.
  std::vector<std::pair<Effect, double>> of_effect;
};

// Simulates a patch of the middle of the sensor several times and takes medians. Its left half
// shows leaves at the nearest depth, its right half leaves at the farthest (at most 1 km). The time
// of the image is that of the patch times the ratio of their pixels. From `sensor` only the noise
// and the bits are used, not the camera, layers and effects. `tell` is called before each
// simulation and may throw to stop. Throws Error for a camera or depths that cannot be simulated.
THICKLENS_EXPORT EffectCosts MeasureEffectCosts(
    const Camera& camera, const DepthRange& range, const SceneSimulationOptions& sensor,
    const EffectSelection& decision, const std::function<void(int done, int total)>& tell);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_EFFECT_COSTS_H_
