#ifndef THICKLENS_TOOLS_BUILD_INFO_H_
#define THICKLENS_TOOLS_BUILD_INFO_H_

#include <string>

namespace thicklens::tools {

std::string Version();  // "0.1.0"

// What `thicklens --version` prints: the version, and the compiler and libraries it was built with.
std::string BuildInfo();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BUILD_INFO_H_
