#ifndef THICKLENS_TOOLS_INTERFACE_DEPTH_CAUSES_H_
#define THICKLENS_TOOLS_INTERFACE_DEPTH_CAUSES_H_

#include <string>

#include "thicklens/depth.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

// Returns what in the map itself may be the reason why its depths are impossible, with the remedy:
// another sign, compression, a relative map, or values beyond the one that stands for the near
// depth. Empty if it has none of these signs.
std::string CauseInMap(const DepthMap& map, const RunScope& run);

// Returns what is wrong with values beyond the one that DepthReadOptions::near_mm belongs to, and
// the scale that is probably meant; empty if there are none.
std::string ValuesBeyondNear(const DepthMap& map, const RunScope& run);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_DEPTH_CAUSES_H_
