#ifndef THICKLENS_TOOLS_MEMORY_AVAILABLE_H_
#define THICKLENS_TOOLS_MEMORY_AVAILABLE_H_

#include <optional>

namespace thicklens::tools {

// What the program may hold in all without making the machine swap: what it holds, and four fifths
// of what the system says is available. Absent where the system does not say it.
std::optional<double> UsualMemoryLimitMib();

// From now on what is freed goes back to the system, though that takes longer: what the program
// holds is what it uses.
void ReturnMemoryAtOnce();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_MEMORY_AVAILABLE_H_
