#ifndef THICKLENS_TOOLS_HARD_CASE_H_
#define THICKLENS_TOOLS_HARD_CASE_H_

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "program_run.h"

namespace thicklens::tools {

// What one command of a hard case has to come to. Whatever it is: no crash, no hang, and after a
// refusal nothing where the output would have been, and a summary that says so.
struct Requirement {
  // Solved: exit code 0, and the error that `error` measures at most `limit`. It may throw Error
  // where the result is not what it should be.
  std::function<double(const std::filesystem::path& folder, const nlohmann::json& summary)> error;
  double limit = 0;
  // Refused: exit code 1 or 2, and one line of reason that holds each of these words.
  bool refused = false;
  std::vector<std::string> words;
  // Solved, or refused with a reason that holds one of these.
  std::vector<std::string> or_refused_with;
};
Requirement Solved(
    std::function<double(const std::filesystem::path& folder, const nlohmann::json& summary)> error,
    double limit);
Requirement Refused(std::vector<std::string> words);

// One command, run in the folder of its case. `--json` is added; `output` is what it writes to.
struct HardRun {
  std::vector<std::string> arguments;  // without the program's name
  std::string output;                  // file or folder; empty: none
  Requirement required;
};

// What there is to run on.
struct HardMachine {
  bool opencl = false;         // a device that works
  bool opencl_double = false;  // and that has numbers of 64 bits
  bool every_way = true;       // false: few of each solver, where each command takes long
};

struct HardCase {
  std::string name;      // of its group and itself: "optics/focus-at-infinity"
  std::string why;       // what makes it hard
  std::string required;  // in words
  // Writes what the commands read into the folder.
  std::function<std::vector<HardRun>(const std::filesystem::path& folder,
                                     const HardMachine& machine)>
      prepare;
};

// How one command of a case ended.
struct HardOutcome {
  std::string command;  // as a person types it in the case's folder
  bool as_required = false;
  std::string measured;         // in words
  std::optional<double> error;  // of a solved one
  double limit = 0;
  double seconds = 0;
};

struct HardResult {
  std::string name, why, required;
  std::vector<HardOutcome> outcomes;
  double seconds = 0;

  bool as_required() const;
  // The worst of all commands, in words.
  std::string Measured() const;
};

// Runs a case's commands by this program in an empty folder that is there; what each wrote is put
// aside in run-NN. Each is ended after so many seconds: that is a failure of the case. Throws Error
// if the case's inputs cannot be written.
HardResult RunHardCase(const HardCase& hard, const std::filesystem::path& folder,
                       const std::string& program, const HardMachine& machine,
                       double limit_seconds);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_HARD_CASE_H_
