#ifndef THICKLENS_TOOLS_OPTIONS_ESTIMATE_CALL_H_
#define THICKLENS_TOOLS_OPTIONS_ESTIMATE_CALL_H_

#include <optional>
#include <vector>

#include "thicklens/estimate.h"
#include "thicklens/estimator/estimate_plan.h"
#include "tools/options/estimate_options.h"
#include "tools/options/interface_options.h"

namespace thicklens::tools {

// The call of the interface that a command line of `thicklens estimate` asks for.
struct EstimateCall {
  Image photo;
  DepthMap depth;
  std::optional<Camera> camera;
  thicklens::EstimateOptions settings;
};

// The options of `thicklens estimate` by the members of the interface.
OptionNames EstimateOptionNames();

// Returns the solver of the command line with its options. The options that another solver has must
// not be given (CheckSolverUsage).
SolverOptions SolverOf(const EstimateOptions& options);
// Returns the solver and the device of a plan, which must be valid.
SolverChoice SolverOf(const estimator::EstimatePlan& plan);
AnySolver AsAnySolver(const SolverOptions& solver);

// Returns the settings of the call without the views of --aperture-of, which a file states. Throws
// UsageError unless they are valid. No file is read.
thicklens::EstimateOptions SettingsOf(const EstimateOptions& options);

// Reads photograph, depth map, camera and the views of --aperture-of. Throws Error and UsageError.
EstimateCall ReadEstimateCall(const EstimateOptions& options, const RunControl& run);

// The curve of the estimate: that of --transfer, of the camera, of the photograph's file, or sRGB.
TransferCurve TransferOf(const EstimateCall& call);

// Reads the files and prepares what a solver starts from. Notices go to stderr. For benchmarks.
Problem PrepareProblemOf(const EstimateOptions& options);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_ESTIMATE_CALL_H_
