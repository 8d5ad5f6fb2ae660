#ifndef THICKLENS_TOOLS_MEMORY_AVAILABLE_H_
#define THICKLENS_TOOLS_MEMORY_AVAILABLE_H_

#include <optional>
#include <string>

namespace thicklens::tools {

// What the program may hold in all without making the machine swap: what it holds, and four fifths
// of what the system says is available to it, or its control group (a container). Absent where the
// system does not say it. `root`: where /proc and /sys are, for tests.
std::optional<double> UsualMemoryLimitMib(const std::string& root = "");

// This is what a program can still have: of the system, of the control group, and of the address
// space where that is limited (ulimit -v).
std::optional<double> MemoryLeftMib(const std::string& root = "");

// From now on what is freed goes back to the system, though that takes longer: what the program
// holds is what it uses.
void ReturnMemoryAtOnce();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_MEMORY_AVAILABLE_H_
