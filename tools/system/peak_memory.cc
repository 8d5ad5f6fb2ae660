#include "tools/system/peak_memory.h"

#include <malloc.h>
#include <sys/resource.h>

#include <fstream>
#include <string>

namespace thicklens::tools {
namespace {

// Reads a value from a line of /proc/self/status such as "VmHWM:     1234 kB".
std::optional<double> StatusMib(const std::string& name) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind(name + ":", 0) == 0) return std::stod(line.substr(name.size() + 1)) / 1024;
  }
  return std::nullopt;
}

}  // namespace

double PeakMemoryMib() {
  // The peak of getrusage() cannot be reset, so it is used only if this one is missing.
  if (const auto peak_mib = StatusMib("VmHWM")) return *peak_mib;
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;  // Linux counts KiB
}

std::optional<double> ForgetPeakMemory() {
#ifdef __GLIBC__
  malloc_trim(0);  // freed memory that is kept would hide what is needed next
#endif
  std::ofstream file("/proc/self/clear_refs");
  file << "5" << std::flush;  // proc(5): resets the peak resident set size
  if (!file) return std::nullopt;
  return StatusMib("VmRSS");
}

}  // namespace thicklens::tools
