#ifndef THICKLENS_TOOLS_STRESS_HARD_CASES_H_
#define THICKLENS_TOOLS_STRESS_HARD_CASES_H_

#include <vector>

#include "tools/options/command_frame.h"
#include "tools/stress/hard_case.h"

namespace thicklens::tools {

// The table of hard cases, by groups; names are unique.
std::vector<HardCase> OpticsHardCases();
std::vector<HardCase> SceneHardCases();
std::vector<HardCase> EstimatorHardCases();
std::vector<HardCase> CalibrationHardCases();
std::vector<HardCase> AllHardCases();

// Finds out whether there is a device that OpenCL cases can run on.
HardMachine ExamineHardMachine();

struct HardCasesOptions {
  std::string only;  // a name, or a group; empty: all
  // keeps inputs and outputs, one folder for each case; empty: does not keep them
  std::string keep_folder;
};
// Runs and prints the table, or the chosen part of it. The result is a refusal if a case is not as
// required. Throws UsageError for an unknown name.
CommandResult RunHardCases(const HardCasesOptions& options, const CommonOptions& common);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_STRESS_HARD_CASES_H_
