#ifndef THICKLENS_TOOLS_PICTURE_LOAD_H_
#define THICKLENS_TOOLS_PICTURE_LOAD_H_

#include "thicklens/estimator/estimate_input.h"
#include "time_law.h"

namespace thicklens::tools {

// What of a picture, its depth and its views decides how long an estimate takes. Makes the file of
// something like a part of a view, to measure what that takes.
PictureLoad PictureLoadOf(const estimator::EstimateInput& input);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PICTURE_LOAD_H_
