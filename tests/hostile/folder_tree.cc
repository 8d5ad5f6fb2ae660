#include "hostile/folder_tree.h"

#include <filesystem>
#include <system_error>

#include "support/temporary_folder.h"

namespace thicklens::hostile {
namespace {

namespace fs = std::filesystem;

// Larger files are sparse, and reading them would take too long.
constexpr std::uintmax_t kLargestBytes = 64 << 20;

std::string DescriptionOf(const fs::directory_entry& entry) {
  std::error_code ignored;
  const fs::file_status status = entry.symlink_status(ignored);
  const std::string mode = std::to_string(static_cast<unsigned>(status.permissions()));
  switch (status.type()) {
    case fs::file_type::symlink:
      return "link to " + fs::read_symlink(entry.path(), ignored).string();
    case fs::file_type::directory:
      return "folder " + mode;
    case fs::file_type::regular: {
      const std::uintmax_t bytes = entry.file_size(ignored);
      return "file " + mode + " of " + std::to_string(bytes) + ": " +
             (bytes <= kLargestBytes ? testing::ContentOf(entry.path().string()) : "");
    }
    default:
      return "neither file nor folder, " + mode;
  }
}

bool IsBelow(const std::string& path, const std::string& folder) {
  return path.size() > folder.size() && path.compare(0, folder.size(), folder) == 0 &&
         path[folder.size()] == '/';
}

// Returns those of `paths` whose folder is not among them.
std::vector<std::string> Outermost(const std::vector<std::string>& paths) {
  std::vector<std::string> outermost;
  for (const std::string& path : paths) {
    bool is_inner = false;
    for (const std::string& folder : outermost) is_inner = is_inner || IsBelow(path, folder);
    if (!is_inner) outermost.push_back(path);
  }
  return outermost;
}

std::vector<std::string> MissingIn(const FolderTree& tree, const FolderTree& of) {
  std::vector<std::string> missing;
  for (const auto& [path, description] : of) {
    if (tree.count(path) == 0) missing.push_back(path);
  }
  return Outermost(missing);
}

}  // namespace

FolderTree TreeOf(const std::string& folder) {
  FolderTree tree;
  std::error_code failure;
  fs::recursive_directory_iterator entry(folder, fs::directory_options::skip_permission_denied,
                                         failure);
  for (; !failure && entry != fs::recursive_directory_iterator(); entry.increment(failure))
    tree[entry->path().lexically_relative(folder).string()] = DescriptionOf(*entry);
  return tree;
}

std::vector<std::string> Changes(const FolderTree& before, const FolderTree& after) {
  std::map<std::string, std::string> kinds;  // the key is the path
  for (const std::string& path : MissingIn(before, after)) kinds[path] = "new ";
  for (const std::string& path : MissingIn(after, before)) kinds[path] = "gone ";
  for (const auto& [path, description] : before) {
    const auto found = after.find(path);
    if (found != after.end() && found->second != description) kinds[path] = "changed ";
  }
  std::vector<std::string> changes;
  for (const auto& [path, kind] : kinds) changes.push_back(kind + path);
  return changes;
}

}  // namespace thicklens::hostile
