#ifndef THICKLENS_TOOLS_SYSTEM_PROCESS_START_H_
#define THICKLENS_TOOLS_SYSTEM_PROCESS_START_H_

#include <string>
#include <utility>
#include <vector>

namespace thicklens::tools {

// Throws Error if the stack limit is less than the program needs (ulimit -s): the program would end
// with a memory fault at an arbitrary place.
void RequireStack();

// Returns the folders for compiled kernels (name of the variable, value) that were removed from the
// environment before main() because they are not absolute.
std::vector<std::pair<std::string, std::string>> ForgottenCaches();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_PROCESS_START_H_
