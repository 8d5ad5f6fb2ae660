#include "tools/options/command_frame.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <opencv2/core/utility.hpp>
#include <optional>
#include <system_error>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/base/temporaries.h"
#include "thicklens/camera.h"
#include "tools/options/deprecated_names.h"
#include "tools/options/option_values.h"
#include "tools/options/run_files.h"
#include "tools/system/interrupt.h"
#include "tools/system/message_line.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxThreads = 1024;
constexpr char kStandardOutput[] = "-";

// File names may be any bytes, but JSON may not: bytes that are not UTF-8 are replaced.
std::string JsonText(const nlohmann::json& summary) {
  return summary.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
}

bool PrintsResults(const CommonOptions& options) {
  return !options.quiet && options.json_path != kStandardOutput;
}

// Returns whether the reason of a refusal may be written to `path`. A user who has mixed up names
// may have given one of the inputs, and a run that is refused early does not know all of them.
bool MayReportRefusal(const std::string& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return true;
  try {
    const std::string older = ReadOwnFile(path, kMaxTextBytes);
    const std::size_t first = older.find_first_not_of(" \t\r\n");
    return first == std::string::npos || older[first] == '{';
  } catch (const Error&) {
    return false;
  }
}

// The destination of --json: a file that is claimed before any work begins, or standard output.
class SummaryOutput {
 public:
  explicit SummaryOutput(const std::string& path) : path_(path) {
    if (!path_.empty() && path_ != kStandardOutput) file_.emplace(path_);
  }

  void Write(const nlohmann::json& summary) {
    const std::string text = JsonText(summary);
    if (path_ == kStandardOutput) std::fwrite(text.data(), 1, text.size(), stdout);
    if (!file_) return;
    file_->Commit(text);
    spdlog::debug("{} written", path_);
  }
  void WriteRefusal(const std::string& reason) {
    if (file_ && !MayReportRefusal(path_)) {
      spdlog::warn(
          "{}: this file is not JSON and is not overwritten; the reason is not written there",
          PrintableUtf8(path_));
      return;
    }
    Write({{"status", "refused"}, {"reason", reason}});
  }

 private:
  std::string path_;
  std::optional<OutputFile> file_;
};

}  // namespace

void AddCommonOptions(CLI::App* command, CommonOptions* options) {
  command
      ->add_option(
          "--json", options->json_path,
          "Write the results to this file as JSON; -: to standard output, instead of the text")
      ->type_name("FILE");
  CLI::Option* quiet = command->add_flag("--quiet", options->quiet, "Print no results");
  command->add_flag("--verbose", options->verbose, "Report each step")->excludes(quiet);
  command->add_option("--threads", options->threads, "Threads to use; 0: one per core")
      ->check(CLI::Range(0, kMaxThreads))
      ->type_name("N");
}

void RunCommand(const CommonOptions& options, const std::function<CommandResult()>& command) {
  if (options.verbose) spdlog::set_level(spdlog::level::debug);
  ReportDeprecated(options, options.deprecated);
  // More threads than cores would not be faster, and the library below would complain.
  cv::setNumThreads(std::min(ResolveThreads(options.threads), ResolveThreads(0)));
  EnterRunOutput(options.json_path);
  SummaryOutput summary(options.json_path);
  CommandResult result;
  try {
    result = command();
    if (!result.is_written) ThrowIfCancelled();
  } catch (const Interrupted&) {
    const std::vector<std::string> in_place = OutputsInPlace();
    if (in_place.empty()) throw;
    throw Error(InterruptedText(in_place));
  } catch (const Error& error) {
    RethrowIfInputWouldBeLost();
    summary.WriteRefusal(MessageLine(error.what()));
    throw;
  }
  AddDeprecatedKeys(&result.summary);
  summary.Write(result.summary);
  if (result.refusal.empty()) return;
  if (result.is_verdict && PrintsResults(options)) throw PrintedRefusal(result.refusal);
  throw Error(result.refusal);
}

std::string WrittenText(const std::vector<std::string>& paths) {
  std::string text;
  for (const std::string& path : paths) {
    if (!path.empty()) text += (text.empty() ? "wrote " : ", ") + PrintableUtf8(path);
  }
  return text.empty() ? text : text + "\n";
}

void PrintResult(const CommonOptions& options, const std::string& text) {
  if (PrintsResults(options)) std::fwrite(text.data(), 1, text.size(), stdout);
}

void ReportDeprecated(const CommonOptions& options, const std::vector<std::string>& notices) {
  if (options.quiet) return;
  for (const std::string& notice : notices) spdlog::warn("{}", PrintableUtf8(notice));
}

void ReportAssumedFields(const model::Camera& camera) {
  for (const std::string& notice : NoticesOf(camera)) spdlog::warn("{}", PrintableUtf8(notice));
}

}  // namespace thicklens::tools
