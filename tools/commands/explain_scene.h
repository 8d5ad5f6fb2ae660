#ifndef THICKLENS_TOOLS_COMMANDS_EXPLAIN_SCENE_H_
#define THICKLENS_TOOLS_COMMANDS_EXPLAIN_SCENE_H_

#include <vector>

#include "thicklens/model/effect_impact.h"
#include "thicklens/model/scene.h"

namespace thicklens::tools {

// Returns places of a depth map without its holes, for each block of 8 x 8 px: the pixel farthest
// from the axis, the depth of maximum blur, and, across the steepest step between neighbours in the
// block, the depth on the other side. The photographed object is not known, so an edge between
// black and white is assumed everywhere.
std::vector<model::EffectSite> PlacesOfDepth(const model::Camera& camera,
                                             const model::Scene& scene);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_COMMANDS_EXPLAIN_SCENE_H_
