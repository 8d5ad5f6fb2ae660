// thicklens doctor --hard-cases: stress tests, in which difficult inputs must be solved or rejected
// on this machine.
#include "tools/stress/stress_suite.h"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <filesystem>
#include <iterator>
#include <memory>
#include <string>
#include <system_error>

#include "thicklens/base/cancel.h"
#include "thicklens/base/deprecation.h"
#include "thicklens/base/error.h"
#include "thicklens/kernels/device.h"
#include "thicklens/kernels/kernels.h"
#include "tools/options/deprecated_names.h"
#include "tools/options/option_values.h"
#include "tools/system/build_info.h"
#include "tools/system/machine.h"
#include "tools/system/progress_line.h"
#include "tools/system/temporary_folder.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

// The limit for one command: the slowest takes a few seconds, and longer on a busy machine.
constexpr double kLimitSeconds = 120;

bool IsChosen(const StressCase& hard, const std::string& only) {
  return only.empty() || hard.name == only || hard.name.rfind(only + "/", 0) == 0;
}

std::vector<StressCase> ChosenCases(const std::string& only) {
  const std::vector<StressCase> all = AllStressCases();
  std::vector<StressCase> chosen;
  std::copy_if(all.begin(), all.end(), std::back_inserter(chosen),
               [&](const StressCase& hard) { return IsChosen(hard, only); });
  if (!chosen.empty()) return chosen;
  std::vector<std::string> names;
  for (const StressCase& hard : all) names.push_back(hard.name);
  throw UsageError(
      fmt::format("--only: there is no hard case or group '{}'; the groups are optics, scene, "
                  "estimator, calibration, and their cases {}",
                  only, fmt::join(names, ", ")));
}

// The place for the files of all cases.
class Workplace {
 public:
  explicit Workplace(const std::string& keep_folder) {
    if (keep_folder.empty()) {
      temporary_ = std::make_unique<TemporaryFolder>("hard-cases");
      root_ = temporary_->path();
      return;
    }
    if (keep_folder == "-") throw Error("--keep -: the name of a folder is expected");
    root_ = fs::absolute(keep_folder);
    std::error_code failure;
    fs::create_directories(root_, failure);
    if (failure) {
      throw Error(fmt::format("{}: cannot be created: {}", keep_folder, failure.message()));
    }
    if (!fs::is_empty(root_, failure) || failure) {
      throw Error(fmt::format("{}: is not empty; --keep needs a new or empty folder", keep_folder));
    }
  }
  fs::path FolderOf(const StressCase& hard) const {
    fs::path folder = root_ / hard.name;
    std::error_code failure;
    fs::create_directories(folder, failure);
    if (failure) {
      throw Error(fmt::format("{}: cannot be created: {}", folder.string(), failure.message()));
    }
    return folder;
  }
  // Files that are not kept are removed before the next case.
  void Leave(const fs::path& folder) const {
    std::error_code ignored;
    if (temporary_) fs::remove_all(folder, ignored);
  }

 private:
  fs::path root_;
  std::unique_ptr<TemporaryFolder> temporary_;
};

StressResult RunOne(const StressCase& hard, const Workplace& workplace, const std::string& program,
                    const Capabilities& capabilities) {
  const fs::path folder = workplace.FolderOf(hard);
  StressResult result;
  try {
    result = RunStressCase(hard, folder, program, capabilities, kLimitSeconds);
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(fmt::format("hard case {}: {}", hard.name, error.what()));
  }
  workplace.Leave(folder);
  return result;
}

std::string RowText(const StressResult& result) {
  return fmt::format(
      "{} {} ({:.1f} s)\n"
      "  hard because  {}\n"
      "  required      {}\n"
      "  measured      {}\n",
      result.as_required() ? "ok  " : "FAIL", result.name, result.seconds, result.why,
      result.required, result.Measured());
}

std::string CommandsText(const StressResult& result) {
  std::string text;
  for (const StressOutcome& outcome : result.outcomes) {
    text += fmt::format("  {} $ {}\n       {} ({:.2f} s)\n", outcome.as_required ? "ok  " : "FAIL",
                        outcome.command, outcome.measured, outcome.seconds);
  }
  return text;
}

nlohmann::json RowJson(const StressResult& result) {
  nlohmann::json runs = nlohmann::json::array();
  for (const StressOutcome& outcome : result.outcomes) {
    runs.push_back({{"command", outcome.command},
                    {"as_required", outcome.as_required},
                    {"measured", outcome.measured},
                    {"error", outcome.error ? nlohmann::json(*outcome.error) : nlohmann::json()},
                    {"limit", outcome.error ? nlohmann::json(outcome.limit) : nlohmann::json()},
                    {"seconds", outcome.seconds}});
  }
  return {{"name", result.name},
          {"why", result.why},
          {"required", result.required},
          {"measured", result.Measured()},
          {"as_required", result.as_required()},
          {"seconds", result.seconds},
          {"runs", runs}};
}

}  // namespace

std::vector<StressCase> AllStressCases() {
  std::vector<StressCase> all;
  for (auto group : {OpticsStressCases(), SceneStressCases(), EstimatorStressCases(),
                     CalibrationStressCases()}) {
    std::move(group.begin(), group.end(), std::back_inserter(all));
  }
  return all;
}

Capabilities ExamineCapabilities() {
  Capabilities capabilities;
  try {
    const auto backend =
        kernels::OpenBackend(kernels::ParseDeviceRequest("opencl"), nullptr, ThrowIfCancelled);
    capabilities.opencl = backend->is_opencl();
    backend->NewDouble();
    capabilities.opencl_double = capabilities.opencl;
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {
    // There is none, or one without double precision.
  }
  return capabilities;
}

CommandResult RunStressCases(const StressSuiteOptions& options, const CommonOptions& common) {
  const std::string only = PresentName(NameKind::kHardCase, options.only);
  if (only != options.only) ReportDeprecated(common, {DeprecationText({options.only, only})});
  const std::vector<StressCase> cases = ChosenCases(only);
  const Workplace workplace(options.keep_folder);
  const std::string program = ThisProgram();
  const Capabilities capabilities = ExamineCapabilities();
  nlohmann::json rows = nlohmann::json::array();
  std::string failed;
  int done = 0, failures = 0, commands = 0;
  double seconds = 0;
  {
    ProgressLine progress("hard cases", common.quiet);
    for (const StressCase& hard : cases) {
      progress.Show(done++, static_cast<int>(cases.size()));
      const StressResult result = RunOne(hard, workplace, program, capabilities);
      std::string row = RowText(result);
      if (cases.size() == 1 || !result.as_required()) row += CommandsText(result);
      PrintResult(common, row);
      rows.push_back(RowJson(result));
      commands += static_cast<int>(result.outcomes.size());
      seconds += result.seconds;
      if (result.as_required()) continue;
      ++failures;
      failed += (failed.empty() ? "" : ", ") + result.name;
    }
  }
  const std::string text = fmt::format(
      "{} of {} as required, {} commands in {:.0f} s{}\n"
      "to repeat a case and keep its commands and files: thicklens doctor --hard-cases --only NAME "
      "--keep DIR\n(the commands run in DIR/NAME, and the files that each wrote are in run-NN "
      "there)\n",
      static_cast<int>(cases.size()) - failures, cases.size(), commands, seconds,
      capabilities.opencl ? "" : ", nothing on OpenCL: no device works");
  PrintResult(common, text);
  const std::string refusal = failed.empty() ? "" : "not as required: " + failed;
  return {{{"status", failures == 0 ? "ok" : "refused"},
           {"reason", refusal},
           {"version", Version()},
           {"processor", ProcessorName()},
           {"opencl", capabilities.opencl},
           {"rows", rows}},
          refusal};
}

}  // namespace thicklens::tools
