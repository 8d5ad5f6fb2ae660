#ifndef THICKLENS_TOOLS_STRESS_STRESS_SUITE_H_
#define THICKLENS_TOOLS_STRESS_STRESS_SUITE_H_

#include <vector>

#include "tools/options/command_frame.h"
#include "tools/stress/stress_case.h"

namespace thicklens::tools {

// The table of hard cases, by groups; names are unique.
std::vector<StressCase> OpticsStressCases();
std::vector<StressCase> SceneStressCases();
std::vector<StressCase> EstimatorStressCases();
std::vector<StressCase> CalibrationStressCases();
std::vector<StressCase> AllStressCases();

// Finds out whether there is a device that OpenCL cases can run on.
Capabilities ExamineCapabilities();

struct StressSuiteOptions {
  std::string only;  // a name, or a group; empty: all
  // keeps inputs and outputs, one folder for each case; empty: does not keep them
  std::string keep_folder;
};
// Runs and prints the table, or the chosen part of it. The result is a refusal if a case is not as
// required. Throws UsageError for an unknown name.
CommandResult RunStressCases(const StressSuiteOptions& options, const CommonOptions& common);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_STRESS_STRESS_SUITE_H_
