#ifndef THICKLENS_TOOLS_OPTIONS_COMMAND_FRAME_H_
#define THICKLENS_TOOLS_OPTIONS_COMMAND_FRAME_H_

#include <CLI/CLI.hpp>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/model/camera.h"
#include "tools/options/run_files.h"

namespace thicklens::tools {

// Options of every command.
struct CommonOptions {
  std::string json_path;  // empty: none; "-": standard output, which then gets no text
  bool quiet = false;
  bool verbose = false;
  int threads = 0;                      // 0: one per core
  std::vector<std::string> deprecated;  // notices of former names on the command line
};
void AddCommonOptions(CLI::App* command, CommonOptions* options);

// The result of a command. A refusal ends the program with exit code 1, after its summary has been
// written.
struct CommandResult {
  nlohmann::json summary;
  std::string refusal;      // one line; empty: none
  bool is_written = false;  // outputs are in place, so an interrupt comes too late
  bool is_verdict = false;  // what was printed ends with the refusal, which is a result
};

// A refusal that was printed already: the program ends with exit code 1 and nothing more.
class PrintedRefusal : public Error {
 public:
  using Error::Error;
};

// Runs a command. Its --json file is claimed before and written after the command. An Error is
// written there as `status: refused` with its reason, unless this could destroy an input. Throws
// what the command throws, Error for a refusal, and PrintedRefusal for a printed verdict.
void RunCommand(const CommonOptions& options, const std::function<CommandResult()>& command);

// Prints a result to stdout, unless --quiet is given or --json uses stdout.
void PrintResult(const CommonOptions& options, const std::string& text);

// Returns "wrote a.yaml, report/index.html", a line; empty paths are left out, and of none there is
// no line.
std::string WrittenText(const std::vector<std::string>& paths);

// Reports former names on stderr, unless --quiet is given; `notices` has one line for each.
void ReportDeprecated(const CommonOptions& options, const std::vector<std::string>& notices);

// Reports on stderr, in one line, which numbers of the camera are assumed.
void ReportAssumedFields(const model::Camera& camera);

// When the command line asks for a command, its action is set.
using CommandAction = std::function<void()>;

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_COMMAND_FRAME_H_
