#include "thicklens/base/run_cost.h"

#include <malloc.h>
#include <unistd.h>

#include <fstream>
#include <limits>

namespace thicklens {

double ResidentBytes() {
  std::ifstream file("/proc/self/statm");
  double total_pages = 0;
  double resident_pages = 0;
  file >> total_pages >> resident_pages;
  return resident_pages * static_cast<double>(sysconf(_SC_PAGESIZE));
}

void ReturnFreedMemory(const std::optional<double>& limit_mib) {
#ifdef __GLIBC__
  if (ResidentBytes() > StayingBytes(limit_mib)) malloc_trim(0);
#endif
}

double StayingBytes(const std::optional<double>& limit_mib) {
  constexpr double kHardlyMissed = 1.0 / 16;
  if (!limit_mib) return std::numeric_limits<double>::infinity();
  return kHardlyMissed * *limit_mib * kBytesPerMib;
}

}  // namespace thicklens
