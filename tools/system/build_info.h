#ifndef THICKLENS_TOOLS_SYSTEM_BUILD_INFO_H_
#define THICKLENS_TOOLS_SYSTEM_BUILD_INFO_H_

#include <string>

namespace thicklens::tools {

std::string Version();  // "0.1.0"

// Returns the output of `thicklens --version`: the version, the compiler and the libraries.
std::string BuildInfo();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_BUILD_INFO_H_
