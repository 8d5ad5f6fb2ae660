#ifndef THICKLENS_TOOLS_INTERFACE_DEPTH_REPORTS_H_
#define THICKLENS_TOOLS_INTERFACE_DEPTH_REPORTS_H_

#include "thicklens/depth.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

// Reports what the reader of the map found.
void ReportReading(const DepthMap& map, RunScope* run);

// Reports which values of the map are taken as holes, or as depths, for a reason that the user may
// see differently.
void ReportHoles(const DepthMap& map, const model::DepthHoles& holes, RunScope* run);

// Returns the values of the map, in which NaN marks the holes, and reports the holes: before the
// values are converted, since a mark that nobody stated may be why they are refused. `run` and
// `holes` may be null. Throws Error that names the map's source.
model::RawDepthMap MarkedMap(const DepthMap& map, RunScope* run,
                             model::DepthHoles* holes = nullptr);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_DEPTH_REPORTS_H_
