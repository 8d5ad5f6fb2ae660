#ifndef THICKLENS_BASE_MEMORY_AVAILABLE_H_
#define THICKLENS_BASE_MEMORY_AVAILABLE_H_

#include <optional>
#include <string>

#include "thicklens/base/export.h"

namespace thicklens {

// Memory that the program may hold in all without making the machine swap: what it holds, and four
// fifths of what the system or its control group (a container) has available. Absent if the system
// does not report it. `root` is the folder of /proc and /sys, for tests.
THICKLENS_EXPORT std::optional<double> UsualMemoryLimitMib(const std::string& root = "");

// Memory that the program can still get from the system, from the control group, and from the
// address space if that is limited (ulimit -v).
THICKLENS_EXPORT std::optional<double> MemoryLeftMib(const std::string& root = "");

// Returns freed memory to the system from now on, although that takes longer: the program then
// holds only what it uses.
THICKLENS_EXPORT void ReturnMemoryAtOnce();

}  // namespace thicklens

#endif  // THICKLENS_BASE_MEMORY_AVAILABLE_H_
