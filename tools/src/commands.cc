#include "commands.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <opencv2/core/utility.hpp>
#include <optional>
#include <system_error>

#include "interrupt.h"
#include "option_values.h"
#include "svg_plot.h"
#include "thicklens/error.h"
#include "thicklens/model/output_file.h"
#include "thicklens/model/parallel.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxThreads = 1024;

// File names may be any bytes, JSON may not: what is no UTF-8 is replaced.
std::string JsonText(const nlohmann::json& summary) {
  return summary.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

bool SameFile(const std::string& a, const std::string& b) {
  if (a.empty() || b.empty()) return false;
  std::error_code failure;
  if (fs::equivalent(a, b, failure)) return true;
  return fs::absolute(a).lexically_normal() == fs::absolute(b).lexically_normal();
}

// The whole path, links followed as far as it exists, without a slash at its end.
fs::path Resolved(const std::string& path) {
  std::error_code failure;
  fs::path resolved = fs::weakly_canonical(fs::absolute(path), failure);
  if (failure) resolved = fs::absolute(path).lexically_normal();
  return resolved.has_filename() ? resolved : resolved.parent_path();
}

// Whether `path` is somewhere below that folder.
bool IsBelow(const std::string& path, const std::string& folder) {
  if (path.empty() || folder.empty()) return false;
  const fs::path inner = Resolved(path);
  const fs::path outer = Resolved(folder);
  const auto [in_inner, in_outer] =
      std::mismatch(inner.begin(), inner.end(), outer.begin(), outer.end());
  return in_outer == outer.end() && in_inner != inner.end();
}

// Every file in it is part of the light field or belongs beside it, not into it.
bool IsLightField(const std::string& folder) {
  std::error_code failure;
  if (folder.empty() || !fs::is_directory(folder, failure)) return false;
  if (fs::exists(fs::path(folder) / "lightfield.yaml", failure)) return true;
  for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    const fs::path name = entry->path().filename();
    if (name.string().rfind("input_Cam", 0) == 0 && name.extension() == ".png") return true;
  }
  return false;
}

void RequireOutputBesideInput(const std::string& output, const std::string& input) {
  if (SameFile(output, input))
    throw UsageError(fmt::format("{}: this input would be overwritten", output));
  std::error_code ignored;
  if (IsBelow(output, input) && IsLightField(input)) {
    throw UsageError(
        fmt::format("{}: lies in the light field {}, which is an input; choose a name outside of "
                    "it",
                    output, input));
  }
  if (IsBelow(input, output) && fs::is_directory(output, ignored)) {
    throw UsageError(
        fmt::format("{}: this folder holds the input {}; choose another name", output, input));
  }
}

}  // namespace

void AddCommonOptions(CLI::App* command, CommonOptions* options) {
  command->add_option("--json", options->json_path, "Write the results to this file, as JSON")
      ->type_name("FILE");
  CLI::Option* quiet = command->add_flag("--quiet", options->quiet, "Print no results");
  command->add_flag("--verbose", options->verbose, "Tell what is done")->excludes(quiet);
  command->add_option("--threads", options->threads, "Threads to use; 0: one per core")
      ->check(CLI::Range(0, kMaxThreads))
      ->type_name("N");
}

void RunCommand(const CommonOptions& options, const std::function<CommandResult()>& command) {
  if (options.verbose) spdlog::set_level(spdlog::level::debug);
  // More than there are cores would not be faster, and the library below would complain.
  cv::setNumThreads(std::min(model::ResolveThreads(options.threads), model::ResolveThreads(0)));
  std::optional<model::OutputFile> json;
  if (!options.json_path.empty()) json.emplace(options.json_path);
  CommandResult result;
  try {
    result = command();
    if (!result.is_written) ThrowIfInterrupted();
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& error) {
    if (json) json->Commit(JsonText({{"status", "refused"}, {"reason", error.what()}}));
    throw;
  }
  if (json) {
    json->Commit(JsonText(result.summary));
    spdlog::debug("{} written", options.json_path);
  }
  if (!result.refusal.empty()) throw Error(result.refusal);
}

std::string NowIso8601() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
}

void PrintResult(const CommonOptions& options, const std::string& text) {
  if (!options.quiet) std::fwrite(text.data(), 1, text.size(), stdout);
}

void TellAssumedFields(const model::Camera& camera) {
  for (const std::string& notice : camera.notices) spdlog::warn("{}", PrintableUtf8(notice));
  const std::vector<std::string> fields = model::AssumedFields(camera);
  if (fields.empty()) return;
  spdlog::warn("camera '{}': assumed, neither published nor measured: {}",
               PrintableUtf8(camera.name), fmt::join(fields, ", "));
}

void RequireDistinctFiles(const std::vector<std::string>& outputs,
                          const std::vector<std::string>& inputs) {
  for (std::size_t i = 0; i < outputs.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (SameFile(outputs[i], outputs[j]))
        throw UsageError(fmt::format("{}: two outputs have this name", outputs[i]));
    }
    for (const std::string& input : inputs) RequireOutputBesideInput(outputs[i], input);
  }
}

}  // namespace thicklens::tools
