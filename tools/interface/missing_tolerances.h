#ifndef THICKLENS_TOOLS_INTERFACE_MISSING_TOLERANCES_H_
#define THICKLENS_TOOLS_INTERFACE_MISSING_TOLERANCES_H_

#include <string>

#include "thicklens/camera.h"

namespace thicklens {

// Returns one line on the numbers of the camera that have no tolerance although a calibration
// depends on them; empty if all have one.
std::string MissingTolerancesLine(const Camera& camera);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_MISSING_TOLERANCES_H_
