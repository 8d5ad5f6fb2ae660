#include "tools/system/machine.h"

#include <cstddef>
#include <fstream>

namespace thicklens::tools {

std::string ProcessorName() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    if (line.rfind("model name", 0) != 0) continue;
    const std::size_t colon = line.find(": ");
    if (colon != std::string::npos) return line.substr(colon + 2);
  }
  return kUnknownProcessor;
}

}  // namespace thicklens::tools
