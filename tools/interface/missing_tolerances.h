#ifndef THICKLENS_TOOLS_INTERFACE_MISSING_TOLERANCES_H_
#define THICKLENS_TOOLS_INTERFACE_MISSING_TOLERANCES_H_

#include <string>

#include "thicklens/camera.h"

namespace thicklens {

// Returns one line on the numbers of the camera that have no tolerance although a calibration
// depends on them; empty if all have one.
std::string MissingTolerancesLine(const Camera& camera);

// Returns one line on a lens that is stated by the data of an objective: what its lengths are, and,
// unless `magnification_is_measured` or the camera file states its tolerance, the one that is
// assumed of its magnification. Empty for other lenses.
std::string ObjectiveLine(const Camera& camera, bool magnification_is_measured);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_MISSING_TOLERANCES_H_
