#ifndef THICKLENS_TOOLS_PEAK_MEMORY_H_
#define THICKLENS_TOOLS_PEAK_MEMORY_H_

#include <optional>

namespace thicklens::tools {

// Most that the process held since it began, or since the last ForgetPeakMemory().
double PeakMemoryMib();

// Makes the peak what the process holds now, and returns that. Absent where the system does not let
// it (Linux does).
std::optional<double> ForgetPeakMemory();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PEAK_MEMORY_H_
