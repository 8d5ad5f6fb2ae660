#ifndef THICKLENS_TOOLS_COMMANDS_ESTIMATE_RUN_H_
#define THICKLENS_TOOLS_COMMANDS_ESTIMATE_RUN_H_

#include "tools/options/command_frame.h"
#include "tools/options/estimate_options.h"

namespace thicklens::tools {

// Runs `thicklens estimate` from its input files to its output files. Throws Error and UsageError.
CommandResult RunEstimate(const EstimateOptions& options);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_COMMANDS_ESTIMATE_RUN_H_
