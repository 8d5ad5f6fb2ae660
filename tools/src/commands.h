#ifndef THICKLENS_TOOLS_COMMANDS_H_
#define THICKLENS_TOOLS_COMMANDS_H_

#include <CLI/CLI.hpp>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "run_files.h"
#include "thicklens/model/camera.h"

namespace thicklens::tools {

// What every command takes.
struct CommonOptions {
  std::string json_path;  // empty: none; "-": standard output, where no text goes then
  bool quiet = false;
  bool verbose = false;
  int threads = 0;  // 0: one per core
};
void AddCommonOptions(CLI::App* command, CommonOptions* options);

// What a command hands back. A refusal ends the program with exit code 1, after its summary has
// been written.
struct CommandResult {
  nlohmann::json summary;
  std::string refusal;      // one line; empty: none
  bool is_written = false;  // outputs are in place: an interrupt comes too late
};

// Runs a command with its --json file claimed before and written after it; an Error is written
// there as `status: refused` with its reason, unless an input might be lost by that. Throws what
// the command throws, and Error for a refusal.
void RunCommand(const CommonOptions& options, const std::function<CommandResult()>& command);

// The moment, UTC, as in 2026-01-31T12:00:00Z.
std::string NowIso8601();

// Results go to stdout, unless --quiet or --json has it.
void PrintResult(const CommonOptions& options, const std::string& text);

// Names on stderr, in one line, which numbers of the camera are somebody's assumption.
void TellAssumedFields(const model::Camera& camera);

// Each adds its command to the program. When the command line asks for it, `action` is set.
using CommandAction = std::function<void()>;
void AddSimulateCommand(CLI::App* program, CommandAction* action);
void AddCalibrateCommand(CLI::App* program, CommandAction* action);
void AddEstimateCommand(CLI::App* program, CommandAction* action);
void AddRenderCommand(CLI::App* program, CommandAction* action);
void AddCompareCommand(CLI::App* program, CommandAction* action);
void AddReportCommand(CLI::App* program, CommandAction* action);
void AddExplainCommand(CLI::App* program, CommandAction* action);
void AddDoctorCommand(CLI::App* program, CommandAction* action);
void AddCameraCommand(CLI::App* program, CommandAction* action);
void AddTargetCommand(CLI::App* program, CommandAction* action);
void AddBenchCommand(CLI::App* program, CommandAction* action);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_COMMANDS_H_
