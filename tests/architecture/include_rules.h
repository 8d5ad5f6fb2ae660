#ifndef THICKLENS_TESTS_ARCHITECTURE_INCLUDE_RULES_H_
#define THICKLENS_TESTS_ARCHITECTURE_INCLUDE_RULES_H_

#include <map>
#include <set>
#include <string>
#include <vector>

#include "architecture/rooms_table.h"

namespace thicklens::architecture {

// Maps each path, relative to the top of the repository and with forward slashes, to the text of
// the file.
using SourceTree = std::map<std::string, std::string>;

// True for a file whose includes are checked: C, C++ and OpenCL sources and headers.
bool IsSource(const std::string& path);

// Returns every include that the table does not allow, every source of a module that is in no room,
// and every public header in a wrong place, each as "file:line: what is wrong; what is allowed".
// `internal_headers`: the paths of the public headers that are not installed.
std::vector<std::string> Violations(const SourceTree& tree, const RoomsTable& table,
                                    const std::set<std::string>& internal_headers = {});

// Returns every include of a private header of a library in the files below the folder `client`,
// and in the private headers that they include directly or through others, each as "file:line:
// includes header". `libraries` are the folders of the libraries, for example "model".
std::vector<std::string> PrivateIncludes(const SourceTree& tree, const std::string& client,
                                         const Names& libraries);

}  // namespace thicklens::architecture

#endif  // THICKLENS_TESTS_ARCHITECTURE_INCLUDE_RULES_H_
