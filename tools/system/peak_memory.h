#ifndef THICKLENS_TOOLS_SYSTEM_PEAK_MEMORY_H_
#define THICKLENS_TOOLS_SYSTEM_PEAK_MEMORY_H_

#include <optional>

namespace thicklens::tools {

// Maximum memory that the process held since it began, or since the last ForgetPeakMemory().
double PeakMemoryMib();

// Resets the peak to what the process holds now, and returns that. Absent if the system does not
// support it (Linux does).
std::optional<double> ForgetPeakMemory();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_PEAK_MEMORY_H_
