#ifndef THICKLENS_TESTS_HOSTILE_FOLDER_TREE_H_
#define THICKLENS_TESTS_HOSTILE_FOLDER_TREE_H_

#include <map>
#include <string>
#include <vector>

namespace thicklens::hostile {

// What lies below a folder: for each path (as seen from the folder) its kind, its permissions and
// its content. Links are not followed.
using FolderTree = std::map<std::string, std::string>;
FolderTree TreeOf(const std::string& folder);

// "new PATH", "gone PATH", "changed PATH"; sorted by path. What lies below a new or vanished folder
// is not listed.
std::vector<std::string> Changes(const FolderTree& before, const FolderTree& after);

}  // namespace thicklens::hostile

#endif  // THICKLENS_TESTS_HOSTILE_FOLDER_TREE_H_
