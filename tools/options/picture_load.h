#ifndef THICKLENS_TOOLS_OPTIONS_PICTURE_LOAD_H_
#define THICKLENS_TOOLS_OPTIONS_PICTURE_LOAD_H_

#include "thicklens/estimator/estimate_input.h"
#include "tools/options/time_law.h"

namespace thicklens::tools {

// Returns the properties of a photograph, its depth and its views that determine how long an
// estimate takes. Encodes a file like a part of a view to measure how long that takes.
PictureLoad PictureLoadOf(const estimator::EstimateInput& input);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_PICTURE_LOAD_H_
