#ifndef THICKLENS_TESTS_HOUSE_INCLUDE_RULES_H_
#define THICKLENS_TESTS_HOUSE_INCLUDE_RULES_H_

#include <map>
#include <string>
#include <vector>

namespace thicklens::house {

// Path relative to the repository's top, with forward slashes -> text.
using SourceTree = std::map<std::string, std::string>;

// The modules' names, in the order of CONTRIBUTING.md.
std::vector<std::string> Modules();

// True for a file whose includes are judged: C, C++ and OpenCL sources and headers.
bool IsSource(const std::string& path);

// Every include that the table of CONTRIBUTING.md does not allow, and every public header in a
// wrong place, each as "file:line: what is wrong; what is allowed".
std::vector<std::string> Violations(const SourceTree& tree);

}  // namespace thicklens::house

#endif  // THICKLENS_TESTS_HOUSE_INCLUDE_RULES_H_
