#ifndef THICKLENS_TOOLS_HARD_CASES_H_
#define THICKLENS_TOOLS_HARD_CASES_H_

#include <vector>

#include "commands.h"
#include "hard_case.h"

namespace thicklens::tools {

// The table of hard cases, by groups; no name twice.
std::vector<HardCase> OpticsHardCases();
std::vector<HardCase> SceneHardCases();
std::vector<HardCase> EstimatorHardCases();
std::vector<HardCase> CalibrationHardCases();
std::vector<HardCase> AllHardCases();

// Whether there is a device that OpenCL rows can run on.
HardMachine ExamineHardMachine();

struct HardCasesOptions {
  std::string only;         // a name, or a group; empty: all
  std::string keep_folder;  // inputs and outputs stay there, a folder for each case; empty: nowhere
};
// Runs the table, or what is chosen of it, and prints it. Refused if a case is not as required.
// Throws UsageError for a name that there is not.
CommandResult RunHardCases(const HardCasesOptions& options, const CommonOptions& common);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_HARD_CASES_H_
