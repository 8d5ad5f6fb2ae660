#ifndef THICKLENS_MODEL_DEPTH_PLACES_H_
#define THICKLENS_MODEL_DEPTH_PLACES_H_

#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/effect_impact.h"
#include "thicklens/model/scene.h"

namespace thicklens::model {

// Returns places of a depth map without its holes, for each block of 8 x 8 px: the pixel farthest
// from the axis, the depth of maximum blur, and, across the steepest step between neighbours in the
// block, the depth on the other side. The photographed object is not known, so an edge between
// black and white is assumed everywhere.
THICKLENS_EXPORT std::vector<EffectSite> PlacesOfDepth(const Camera& camera, const Scene& scene);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_DEPTH_PLACES_H_
