#ifndef THICKLENS_TOOLS_SYSTEM_MACHINE_H_
#define THICKLENS_TOOLS_SYSTEM_MACHINE_H_

#include <string>

namespace thicklens::tools {

constexpr char kUnknownProcessor[] = "unknown";
std::string ProcessorName();  // kUnknownProcessor if the name is not known

// Returns the current time, UTC, as in 2026-01-31T12:00:00Z.
std::string NowIso8601();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_MACHINE_H_
