#include "tools/stress/stress_case.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <sstream>
#include <system_error>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/base/stopwatch.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

constexpr char kSummaryFile[] = "summary.json";

// Returns the lines on stderr that report the failure of a run.
std::vector<std::string> ErrorLines(const std::string& err) {
  std::vector<std::string> found;
  std::istringstream lines(err);
  constexpr char kBegin[] = "thicklens: error: ";
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind(kBegin, 0) == 0) found.push_back(line.substr(sizeof(kBegin) - 1));
  }
  return found;
}

struct Judgement {
  bool as_required = false;
  std::string measured;
  std::optional<double> error;
};

Judgement JudgeRefusal(const Requirement& required, const ProgramRun& run, const fs::path& output) {
  const std::vector<std::string> errors = ErrorLines(run.err);
  if (run.exit_code == 0) return {false, "not refused", {}};
  if (errors.size() != 1) {
    return {
        false, fmt::format("refused with {} lines of reason instead of one", errors.size()), {}};
  }
  for (const std::string& word : required.words) {
    if (errors.front().find(word) == std::string::npos) {
      return {false, fmt::format("refused without the text '{}': {}", word, errors.front()), {}};
    }
  }
  std::error_code unreachable;
  if (!output.empty() && fs::exists(output, unreachable)) {
    return {false, "refused, but left " + output.filename().string(), {}};
  }
  return {true, "refused: " + errors.front(), {}};
}

Judgement JudgeSolution(const Requirement& required, const ProgramRun& run, const fs::path& folder,
                        const nlohmann::json& summary) {
  if (run.exit_code != 0) {
    const std::vector<std::string> errors = ErrorLines(run.err);
    return {false, "refused: " + (errors.empty() ? run.err : errors.front()), {}};
  }
  if (summary.value("status", "") == "refused") {
    return {false, "done, but its summary states that it was refused", {}};
  }
  try {
    const double error = required.error(folder, summary);
    // NaN counts as wrong, too.
    if (!(error <= required.limit)) {
      return {false, fmt::format("error {:.2g}, more than {:g}", error, required.limit), error};
    }
    return {true, fmt::format("error {:.2g}, at most {:g}", error, required.limit), error};
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& wrong) {
    return {false, wrong.what(), {}};
  }
}

// Returns the summary of the run; not a JSON object if there is none to read.
nlohmann::json SummaryOf(const fs::path& folder) {
  std::error_code unreachable;
  const fs::path file = folder / kSummaryFile;
  if (!fs::exists(file, unreachable)) return nullptr;
  return nlohmann::json::parse(ReadWholeFile(file.string()), nullptr, false);
}

// Returns whether a run that may be refused was refused with one of the allowed reasons.
bool IsOtherRefusal(const Requirement& required, const ProgramRun& run) {
  if (run.exit_code == 0) return false;
  for (const std::string& line : ErrorLines(run.err)) {
    for (const std::string& reason : required.or_refused_with) {
      if (line.find(reason) != std::string::npos) return true;
    }
  }
  return false;
}

Judgement Judge(const StressRun& hard, const ProgramRun& run, const fs::path& folder,
                double limit_seconds) {
  if (run.timed_out) return {false, fmt::format("not finished after {:g} s", limit_seconds), {}};
  if (run.signal != 0) return {false, fmt::format("crashed by signal {}", run.signal), {}};
  if (run.exit_code < 0 || run.exit_code > 2) {
    return {false, fmt::format("exit code {}: {}", run.exit_code, run.err), {}};
  }
  const nlohmann::json summary = SummaryOf(folder);
  if (hard.required.refused || IsOtherRefusal(hard.required, run)) {
    // Wrong usage is reported before a summary exists.
    if (run.exit_code == 1 && (!summary.is_object() || summary.value("status", "") != "refused")) {
      return {false, "refused, but its summary does not state that", {}};
    }
    return JudgeRefusal(hard.required, run, hard.output.empty() ? "" : folder / hard.output);
  }
  if (run.exit_code == 0 && !summary.is_object()) {
    return {false, "its summary is not a JSON object", {}};
  }
  return JudgeSolution(hard.required, run, folder, summary);
}

// Moves the output out of the way of the next run, so that it can be examined later.
void PutAside(const StressRun& run, std::size_t number, const fs::path& folder) {
  const fs::path aside = folder / fmt::format("run-{:02}", number);
  std::error_code ignored;
  fs::create_directories(aside, ignored);
  for (const std::string& name : {std::string(kSummaryFile), std::string("stdout.txt"),
                                  std::string("stderr.txt"), run.output}) {
    if (!name.empty()) fs::rename(folder / name, aside / name, ignored);
  }
}

}  // namespace

Requirement Solved(
    std::function<double(const fs::path& folder, const nlohmann::json& summary)> error,
    double limit) {
  Requirement required;
  required.error = std::move(error);
  required.limit = limit;
  return required;
}

Requirement Refused(std::vector<std::string> words) {
  Requirement required;
  required.refused = true;
  required.words = std::move(words);
  return required;
}

bool StressResult::as_required() const {
  return !outcomes.empty() &&
         std::all_of(outcomes.begin(), outcomes.end(),
                     [](const StressOutcome& outcome) { return outcome.as_required; });
}

std::string StressResult::Measured() const {
  int failed = 0, refused = 0;
  const StressOutcome *first_failed = nullptr, *first_refused = nullptr, *worst = nullptr;
  const auto share = [](const StressOutcome& outcome) {
    return outcome.limit > 0 ? *outcome.error / outcome.limit : *outcome.error;
  };
  for (const StressOutcome& outcome : outcomes) {
    if (!outcome.as_required) {
      ++failed;
      if (first_failed == nullptr) first_failed = &outcome;
    } else if (!outcome.error) {
      ++refused;
      if (first_refused == nullptr) first_refused = &outcome;
    } else if (worst == nullptr || share(outcome) > share(*worst)) {
      worst = &outcome;
    }
  }
  if (first_failed != nullptr) {
    return fmt::format("{} of {} not as required, the first: {}: {}", failed, outcomes.size(),
                       first_failed->command, first_failed->measured);
  }
  std::string text;
  const auto solved = static_cast<int>(outcomes.size()) - refused;
  if (worst != nullptr) {
    text = fmt::format("{} solved, {}", solved, worst->measured);
  }
  if (first_refused != nullptr) {
    text += text.empty() ? "" : "; ";
    text += refused == 1 ? first_refused->measured
                         : fmt::format("{} times {}", refused, first_refused->measured);
  }
  return text;
}

StressResult RunStressCase(const StressCase& hard, const fs::path& folder,
                           const std::string& program, const Capabilities& capabilities,
                           double limit_seconds) {
  const auto start = Clock::now();
  StressResult result;
  result.name = hard.name;
  result.why = hard.why;
  result.required = hard.required;
  for (const StressRun& run : hard.prepare(folder, capabilities)) {
    std::vector<std::string> words = {"thicklens"};
    words.insert(words.end(), run.arguments.begin(), run.arguments.end());
    StressOutcome outcome;
    outcome.command = ShellCommand(words);
    std::vector<std::string> arguments = run.arguments;
    arguments.insert(arguments.end(), {"--json", kSummaryFile, "--quiet"});
    const ProgramRun ended = RunProgram(program, arguments, folder, limit_seconds);
    const Judgement judged = Judge(run, ended, folder, limit_seconds);
    outcome.as_required = judged.as_required;
    std::string measured = judged.measured;
    std::replace(measured.begin(), measured.end(), '\n', ' ');
    outcome.measured = PrintableUtf8(measured);
    outcome.error = judged.error;
    outcome.limit = run.required.limit;
    outcome.seconds = ended.seconds;
    result.outcomes.push_back(std::move(outcome));
    PutAside(run, result.outcomes.size(), folder);
  }
  result.seconds = SecondsSince(start);
  return result;
}

}  // namespace thicklens::tools
