#ifndef THICKLENS_TOOLS_INTERFACE_FIT_DEPTH_H_
#define THICKLENS_TOOLS_INTERFACE_FIT_DEPTH_H_

#include <string>

#include "thicklens/depth_fit.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

// Makes holes of the values below the confidence, and those of confidence 0. Throws Error if none
// remains.
void DropDoubtful(const DepthFit& fit, DepthMap* depth, RunScope* run);

// FitDepth within the scope of another call, which keeps its notices. The values below the
// confidence are holes already.
DepthMap FitDepthWithin(DepthMap depth, const Image& photo, const DepthFit& fit,
                        std::string* described, RunScope* run);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_FIT_DEPTH_H_
