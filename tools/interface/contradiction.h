#ifndef THICKLENS_TOOLS_INTERFACE_CONTRADICTION_H_
#define THICKLENS_TOOLS_INTERFACE_CONTRADICTION_H_

#include <string>

#include "thicklens/depth.h"
#include "thicklens/estimate.h"
#include "tools/interface/problem.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

// Residual over the noise from which an estimate that nothing explains is partial. Exact maps of
// hard scenes had up to 2.4.
constexpr double kUnexplainedResidual = 3;

// The depth map without its values, for messages.
struct DepthOrigin {
  std::string name;
  DepthMeaning meaning;
  model::DepthFlip flip = model::DepthFlip::kNone;  // by which it was read
};

// Checks whether the photograph of an estimate by SceneSolver contradicts its depth, and keeps what
// was found in the diagnostics. `is_in_doubt`: the residual casts doubt on the depth.
void FindContradiction(const PreparedProblem& prepared, bool is_in_doubt, RunScope* run,
                       LightFieldEstimate* estimate);

// Returns why the depth contradicts the photograph, with the options that remove the most likely
// causes; empty if it does not.
std::string ContradictionText(const DepthOrigin& depth, const estimator::DepthContradiction& found,
                              const RunScope& run);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_CONTRADICTION_H_
