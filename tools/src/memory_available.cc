#include "memory_available.h"

#include <malloc.h>

#include <fstream>
#include <string>

namespace thicklens::tools {
namespace {

// A line "NAME:  1234 kB" of one of Linux's files.
std::optional<double> Mebibytes(const std::string& path, const std::string& name) {
  std::ifstream file(path);
  std::string word;
  while (file >> word) {
    double kib = 0;
    if (word == name + ":" && file >> kib) return kib / 1024;
  }
  return std::nullopt;
}

}  // namespace

std::optional<double> UsualMemoryLimitMib() {
  constexpr double kShare = 0.8;
  const std::optional<double> available = Mebibytes("/proc/meminfo", "MemAvailable");
  if (!available) return std::nullopt;
  return kShare * *available + Mebibytes("/proc/self/status", "VmRSS").value_or(0);
}

void ReturnMemoryAtOnce() {
#ifdef __GLIBC__
  constexpr int kBytes = 1 << 20;
  mallopt(M_MMAP_THRESHOLD, kBytes);
  mallopt(M_TRIM_THRESHOLD, kBytes);
#endif
}

}  // namespace thicklens::tools
