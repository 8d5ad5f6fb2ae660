#ifndef THICKLENS_TOOLS_OPTIONS_MISSING_TOLERANCES_H_
#define THICKLENS_TOOLS_OPTIONS_MISSING_TOLERANCES_H_

#include <string>

#include "thicklens/model/camera.h"

namespace thicklens::tools {

// Lists the numbers of the camera that affect the results and are stated without a tolerance;
// empty if there are none.
std::string MissingTolerancesLine(const model::Camera& camera);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_MISSING_TOLERANCES_H_
