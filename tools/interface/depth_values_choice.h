#ifndef THICKLENS_TOOLS_INTERFACE_DEPTH_VALUES_CHOICE_H_
#define THICKLENS_TOOLS_INTERFACE_DEPTH_VALUES_CHOICE_H_

#include <Eigen/Core>
#include <string>

#include "thicklens/depth.h"
#include "thicklens/estimate.h"
#include "tools/interface/problem.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

// Gives a relative map the scale and the offset with which the blur of the photograph agrees, so
// that it is a map of disparities. Other maps stay as they are. `prepared` has the image, its curve
// and the weights of the views, and a grid if there is a camera. Throws Error where the photograph
// does not determine both, with what has to be stated.
void FindRelativeValues(const EstimateOptions& options, const PreparedProblem& prepared,
                        DepthMap* map, EstimateDiagnostics* diagnostics, RunScope* run);

// Compares scale and offset of a map of disparities with the blur of the photograph, and corrects
// them where the options allow it and the photograph shows it for certain. `meaning` is that of the
// disparities of `prepared`.
void CorrectValues(const EstimateOptions& options, DepthMeaning* meaning, PreparedProblem* prepared,
                   EstimateDiagnostics* diagnostics, RunScope* run);

// Why the blur of the photograph contradicts the values of the map, with the options that state
// better ones; empty if it does not, or if they were corrected.
std::string ValuesReason(const std::string& name, const DepthMeaning& meaning,
                         const EstimateDiagnostics& diagnostics, const RunScope& run);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_DEPTH_VALUES_CHOICE_H_
