#ifndef THICKLENS_TOOLS_COMMANDS_COMMANDS_H_
#define THICKLENS_TOOLS_COMMANDS_COMMANDS_H_

#include <CLI/CLI.hpp>

#include "tools/options/command_frame.h"

namespace thicklens::tools {

// Each function adds its command to the program. When the command line asks for the command,
// `action` is set.
void AddSimulateCommand(CLI::App* program, CommandAction* action);
void AddCalibrateCommand(CLI::App* program, CommandAction* action);
void AddEstimateCommand(CLI::App* program, CommandAction* action);
void AddRenderCommand(CLI::App* program, CommandAction* action);
void AddCompareCommand(CLI::App* program, CommandAction* action);
void AddReportCommand(CLI::App* program, CommandAction* action);
void AddExplainCommand(CLI::App* program, CommandAction* action);
void AddDoctorCommand(CLI::App* program, CommandAction* action);
void AddCameraCommand(CLI::App* program, CommandAction* action);
void AddDepthCommand(CLI::App* program, CommandAction* action);
void AddFramesCommand(CLI::App* program, CommandAction* action);
void AddMtfCommand(CLI::App* program, CommandAction* action);
void AddUndistortCommand(CLI::App* program, CommandAction* action);
void AddPlanCommand(CLI::App* program, CommandAction* action);
void AddTargetCommand(CLI::App* program, CommandAction* action);
void AddBenchCommand(CLI::App* program, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_COMMANDS_COMMANDS_H_
