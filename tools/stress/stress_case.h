#ifndef THICKLENS_TOOLS_STRESS_STRESS_CASE_H_
#define THICKLENS_TOOLS_STRESS_STRESS_CASE_H_

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tools/system/program_run.h"

namespace thicklens::tools {

// The required outcome of one command of a hard case. In every case there must be no crash and no
// hang, and a refusal must leave no output and a summary that reports it.
struct Requirement {
  // Solved: exit code 0, and the error that `error` measures is at most `limit`. `error` may throw
  // Error if the result is wrong.
  std::function<double(const std::filesystem::path& folder, const nlohmann::json& summary)> error;
  double limit = 0;
  // Refused: exit code 1 or 2, and a one-line reason that contains each of these words.
  bool refused = false;
  std::vector<std::string> words;
  // Solved, or refused with a reason that contains one of these words.
  std::vector<std::string> or_refused_with;
};
Requirement Solved(
    std::function<double(const std::filesystem::path& folder, const nlohmann::json& summary)> error,
    double limit);
Requirement Refused(std::vector<std::string> words);

// One command, run in the folder of its case. `--json` is added; the command writes to `output`.
struct StressRun {
  std::vector<std::string> arguments;  // without the program's name
  std::string output;                  // file or folder; empty: none
  Requirement required;
};

// The machine that the cases run on.
struct Capabilities {
  bool opencl = false;         // a working device
  bool opencl_double = false;  // the device also has numbers of 64 bits
  bool every_way = true;       // false: a few plans of each solver, where each command takes long
};

struct StressCase {
  std::string name;      // group and name: "optics/focus-at-infinity"
  std::string why;       // what makes it hard
  std::string required;  // in words
  // Writes the input files of the commands into the folder.
  std::function<std::vector<StressRun>(const std::filesystem::path& folder,
                                       const Capabilities& capabilities)>
      prepare;
};

// How one command of a case ended.
struct StressOutcome {
  std::string command;  // as a user types it in the case's folder
  bool as_required = false;
  std::string measured;         // in words
  std::optional<double> error;  // of a solved command
  double limit = 0;
  double seconds = 0;
};

struct StressResult {
  std::string name, why, required;
  std::vector<StressOutcome> outcomes;
  double seconds = 0;

  bool as_required() const;
  // Returns the worst outcome of all commands, in words.
  std::string Measured() const;
};

// Runs a case's commands with this program in an existing empty folder; the output of each command
// is moved to run-NN. A command that exceeds `limit_seconds` is ended, which is a failure of the
// case. Throws Error if the case's inputs cannot be written.
StressResult RunStressCase(const StressCase& hard, const std::filesystem::path& folder,
                           const std::string& program, const Capabilities& capabilities,
                           double limit_seconds);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_STRESS_STRESS_CASE_H_
