#ifndef THICKLENS_TOOLS_INTERFACE_FALLOFF_CHOICE_H_
#define THICKLENS_TOOLS_INTERFACE_FALLOFF_CHOICE_H_

#include <string>

#include "thicklens/estimate.h"
#include "tools/interface/problem.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

// Tests whether the photograph `photo` shows the fall-off that is about to be divided out, and
// takes the effect off where it should stay: where the photograph was corrected for it, and where
// it is undecided but would brighten encoded values of a corner by more than a quarter. What the
// caller stated is not tested, nor a fall-off of less than a tenth. Reports what was found and
// done.
void DecideFalloff(const std::string& photo, const EstimateOptions& options,
                   PreparedProblem* prepared, EstimateDiagnostics* diagnostics, RunScope* run);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_FALLOFF_CHOICE_H_
