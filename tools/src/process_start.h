#ifndef THICKLENS_TOOLS_PROCESS_START_H_
#define THICKLENS_TOOLS_PROCESS_START_H_

namespace thicklens::tools {

// Throws Error where the stack is limited to less than the program needs (ulimit -s): it would end
// by a fault of memory somewhere.
void RequireStack();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PROCESS_START_H_
