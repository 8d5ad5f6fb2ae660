#include "model/base/folder_content.h"

#include <fmt/format.h>
#include <fnmatch.h>

#include <algorithm>
#include <iterator>
#include <new>
#include <system_error>

#include "model/base/output_part.h"
#include "model/base/output_target.h"
#include "thicklens/base/error.h"

namespace thicklens {

const char kInnerPartStem[] = "thicklens";

namespace {

namespace fs = std::filesystem;

Error WouldBeLost(const std::string& shown, const std::string& name) {
  return Error(
      fmt::format("{}: this folder also contains '{}', which would be lost; move it away or choose "
                  "another name",
                  shown, name));
}

// The entries of a folder. Throws Error if they cannot be read.
std::vector<fs::path> Entries(const fs::path& folder, const std::string& shown) {
  std::vector<fs::path> entries;
  std::error_code failure;
  fs::directory_iterator entry(folder, failure);
  for (; !failure && entry != fs::directory_iterator(); entry.increment(failure))
    entries.push_back(entry->path());
  if (failure == std::errc::not_enough_memory) throw std::bad_alloc();
  if (failure) {
    throw Error(fmt::format("{}: cannot be written, because its content cannot be read: {}", shown,
                            failure.message()));
  }
  return entries;
}

bool IsIncidental(const fs::path& entry) {
  const std::string name = entry.filename().string();
  return name == "lost+found" || IsPartName(name, kInnerPartStem);
}

bool IsFolder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(fs::symlink_status(path, ignored));
}

// Throws Error for an entry of the folder `name` in an output folder that is a folder itself or
// matches none of the patterns.
void RequireOwn(const fs::path& folder, const std::string& shown, const std::string& name,
                const std::vector<std::string>& patterns) {
  for (const fs::path& entry : Entries(folder / name, shown)) {
    const std::string inner = name + "/" + entry.filename().string();
    const bool is_own = std::any_of(patterns.begin(), patterns.end(), [&](const auto& pattern) {
      return ::fnmatch(pattern.c_str(), inner.c_str(), FNM_PATHNAME) == 0;
    });
    if (!is_own || IsFolder(entry)) throw WouldBeLost(shown, inner);
  }
}

}  // namespace

std::vector<fs::path> EntriesInPlace(const fs::path& folder) {
  std::vector<fs::path> entries = Entries(folder, folder.string());
  entries.erase(std::remove_if(entries.begin(), entries.end(), IsIncidental), entries.end());
  return entries;
}

void FolderContent::RequireReplaceable(const fs::path& folder, const std::string& shown,
                                       bool in_place, bool without_marker) const {
  std::error_code ignored;
  const fs::file_status status = fs::symlink_status(folder, ignored);
  if (!fs::exists(status)) return;
  if (!fs::is_directory(status))
    throw Error(fmt::format("{}: is no longer a folder; a folder is expected", shown));
  const std::vector<fs::path> entries = in_place ? EntriesInPlace(folder) : Entries(folder, shown);
  if (!entries.empty() && !without_marker && !fs::exists(folder / marker_file, ignored)) {
    throw Error(fmt::format(
        "{}: this folder contains other files (but no {}) and is not replaced; choose another name",
        shown, marker_file));
  }
  for (const fs::path& entry : entries) {
    const std::string name = entry.filename().string();
    if (IsMountPoint(entry)) {
      throw Error(
          fmt::format("{}: contains '{}', where another file system is mounted, and cannot be "
                      "replaced; choose another name",
                      shown, name));
    }
    if (own_entries.empty()) continue;
    if (std::find(own_entries.begin(), own_entries.end(), name) != own_entries.end()) continue;
    std::vector<std::string> patterns;  // patterns of the entries that it may contain
    std::copy_if(own_entries.begin(), own_entries.end(), std::back_inserter(patterns),
                 [&](const std::string& own) { return own.rfind(name + "/", 0) == 0; });
    if (patterns.empty() || !IsFolder(entry)) throw WouldBeLost(shown, name);
    RequireOwn(folder, shown, name, patterns);
  }
}

}  // namespace thicklens
