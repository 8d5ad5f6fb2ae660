#include "tools/options/run_files.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <mutex>
#include <optional>
#include <set>
#include <system_error>
#include <utility>

#include "thicklens/base/input_file.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

// Identifies the file that a path leads to, following links; none if there is nothing.
using FileIdentity = std::optional<std::pair<dev_t, ino_t>>;
FileIdentity IdentityOf(const std::string& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) return std::nullopt;
  return std::pair(info.st_dev, info.st_ino);
}

// Returns the whole path without a slash at its end, following links as far as the path exists,
// including a link to a file that does not exist yet.
fs::path ResolvedPath(const std::string& path) {
  constexpr int kMaxLinks = 40;  // the limit of the system
  std::error_code failure;
  fs::path named = fs::absolute(path);
  for (int i = 0; i < kMaxLinks && fs::is_symlink(named, failure); ++i) {
    const fs::path target = fs::read_symlink(named, failure);
    if (failure) break;
    named = named.parent_path() / target;  // only `target` if it is absolute
  }
  fs::path resolved = fs::weakly_canonical(named, failure);
  if (failure) resolved = named.lexically_normal();
  return resolved.has_filename() ? resolved : resolved.parent_path();
}

struct RunOutput {
  std::string path;
  fs::path resolved;
  FileIdentity identity;
  bool is_folder = false;  // an existing folder
};

bool IsSame(const RunOutput& output, const std::string& path) {
  if (const FileIdentity there = IdentityOf(path)) return there == output.identity;
  return ResolvedPath(path) == output.resolved;
}

// Returns whether `folder` is one of the folders that lead to `inner`. The folders are compared by
// identity, so that two mounts of one folder count as one.
bool LeadsThrough(const fs::path& inner, const FileIdentity& folder) {
  if (!folder) return false;
  for (fs::path at = inner; at.has_relative_path();) {
    at = at.parent_path();
    if (IdentityOf(at.string()) == folder) return true;
  }
  return false;
}

// A light field owns every file in its folder; other files belong beside the folder, not into it.
bool IsLightField(const std::string& folder) {
  std::error_code failure;
  if (!fs::is_directory(folder, failure)) return false;
  if (fs::exists(fs::path(folder) / "lightfield.yaml", failure)) return true;
  for (fs::directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    const fs::path name = entry->path().filename();
    if (name.string().rfind("input_Cam", 0) == 0 && name.extension() == ".png") return true;
  }
  return false;
}

class RunFiles {
 public:
  void Enter(const std::string& path) {
    if (path.empty() || path == "-") return;
    std::error_code failure;
    const RunOutput output{path, ResolvedPath(path), IdentityOf(path),
                           fs::is_directory(path, failure)};
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const RunOutput& other : outputs_) {
      if (IsSame(other, path))
        throw UsageError(fmt::format("{}: two outputs have this name", path));
      RequireBeside(output, other);
      RequireBeside(other, output);
    }
    outputs_.push_back(output);
    in_no_output_.clear();
  }

  bool Has(const std::string& path) {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::any_of(outputs_.begin(), outputs_.end(),
                       [&](const RunOutput& output) { return output.path == path; });
  }

  // May be called from any thread.
  void RequireNoOutput(const std::string& input) {
    if (input.empty()) return;
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const RunOutput& output : outputs_) {
      if (!IsSame(output, input)) continue;
      Refuse(output.path == input
                 ? fmt::format("{}: this input would be overwritten; choose another name", input)
                 : fmt::format("{}: the input {} would be overwritten; choose another name",
                               output.path, input));
    }
    // Thousands of frames and views may lie in one folder; a link may lead anywhere.
    std::error_code ignored;
    const std::string folder = fs::path(input).parent_path().string();
    const bool is_link = fs::is_symlink(input, ignored);
    if (!is_link && in_no_output_.count(folder) > 0) return;
    const fs::path resolved = ResolvedPath(input);
    for (const RunOutput& output : outputs_) {
      if (!output.is_folder || !LeadsThrough(resolved, output.identity)) continue;
      Refuse(fmt::format("{}: this folder holds the input {}; choose another name", output.path,
                         input));
    }
    if (!is_link) in_no_output_.insert(folder);
  }

  void RequireOutside(const std::string& light_field) {
    if (light_field.empty() || !IsLightField(light_field)) return;
    const FileIdentity folder = IdentityOf(light_field);
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const RunOutput& output : outputs_) {
      if (!LeadsThrough(output.resolved, folder)) continue;
      Refuse(
          fmt::format("{}: lies in the light field {}, which is an input; choose a name outside it",
                      output.path, light_field));
    }
  }

  void RethrowRefusal() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!refusal_.empty()) throw InputWouldBeLost(refusal_);
  }

 private:
  void Refuse(const std::string& why) {
    refusal_ = why;
    throw InputWouldBeLost(why);
  }

  static void RequireBeside(const RunOutput& inner, const RunOutput& outer) {
    if (!outer.is_folder || !LeadsThrough(inner.resolved, outer.identity)) return;
    throw UsageError(fmt::format(
        "{}: lies in the output folder {}, which is replaced as a whole; choose a name outside it",
        inner.path, outer.path));
  }

  std::mutex mutex_;
  std::vector<RunOutput> outputs_;
  std::string refusal_;
  std::set<std::string> in_no_output_;  // folders of inputs
};

// There is only one: a process runs one command.
RunFiles& FilesOfThisRun() {
  static RunFiles files;
  return files;
}

}  // namespace

void EnterRunOutput(const std::string& output) {
  if (!FilesOfThisRun().Has(output)) FilesOfThisRun().Enter(output);
  WatchInputs([](const std::string& input) { FilesOfThisRun().RequireNoOutput(input); });
}

void RethrowIfInputWouldBeLost() { FilesOfThisRun().RethrowRefusal(); }

void RequireDistinctFiles(const std::vector<std::string>& outputs,
                          const std::vector<std::string>& inputs) {
  for (const std::string& output : outputs) FilesOfThisRun().Enter(output);
  WatchInputs([](const std::string& input) { FilesOfThisRun().RequireNoOutput(input); });
  for (const std::string& input : inputs) {
    FilesOfThisRun().RequireNoOutput(input);
    FilesOfThisRun().RequireOutside(input);
  }
}

}  // namespace thicklens::tools
