#ifndef THICKLENS_TOOLS_SYSTEM_MACHINE_H_
#define THICKLENS_TOOLS_SYSTEM_MACHINE_H_

#include <string>

namespace thicklens::tools {

constexpr char kUnknownProcessor[] = "unknown";
std::string ProcessorName();  // kUnknownProcessor if the name is not known

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_MACHINE_H_
