#ifndef THICKLENS_TOOLS_PROCESS_START_H_
#define THICKLENS_TOOLS_PROCESS_START_H_

#include <string>
#include <utility>
#include <vector>

namespace thicklens::tools {

// Throws Error where the stack is limited to less than the program needs (ulimit -s): it would end
// by a fault of memory somewhere.
void RequireStack();

// The folders for compiled kernels (name of the variable, value) that were taken out of the
// environment before main() because they are not absolute.
std::vector<std::pair<std::string, std::string>> ForgottenCaches();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PROCESS_START_H_
