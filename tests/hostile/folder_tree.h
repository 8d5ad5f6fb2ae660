#ifndef THICKLENS_TESTS_HOSTILE_FOLDER_TREE_H_
#define THICKLENS_TESTS_HOSTILE_FOLDER_TREE_H_

#include <map>
#include <string>
#include <vector>

namespace thicklens::hostile {

// Content of a folder: maps each path, relative to the folder, to its kind, its permissions and its
// content. Links are not followed.
using FolderTree = std::map<std::string, std::string>;
FolderTree TreeOf(const std::string& folder);

// Returns lines "new PATH", "gone PATH" and "changed PATH", sorted by path. The content of a new or
// vanished folder is not listed.
std::vector<std::string> Changes(const FolderTree& before, const FolderTree& after);

}  // namespace thicklens::hostile

#endif  // THICKLENS_TESTS_HOSTILE_FOLDER_TREE_H_
