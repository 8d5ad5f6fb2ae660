#ifndef THICKLENS_TOOLS_EXPLAIN_SCENE_H_
#define THICKLENS_TOOLS_EXPLAIN_SCENE_H_

#include <vector>

#include "thicklens/model/effect_impact.h"
#include "thicklens/model/scene.h"

namespace thicklens::tools {

// The places of a depth map, holes left out, one for each block of 8 x 8 px: the pixel farthest
// from the axis, the depth of most blur, and, across the steepest step between neighbours in it,
// what is on the other side. What is photographed is not known: an edge between black and white
// everywhere.
std::vector<model::EffectPlace> PlacesOfDepth(const model::Camera& camera,
                                              const model::Scene& scene);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_EXPLAIN_SCENE_H_
