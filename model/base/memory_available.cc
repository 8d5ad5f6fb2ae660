#include "thicklens/base/memory_available.h"

#include <malloc.h>
#include <sys/resource.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

namespace thicklens {
namespace {

// The number behind a name in one of Linux's files.
std::optional<double> NumberBehind(const std::string& name, const std::string& path) {
  std::ifstream file(path);
  std::string word;
  while (file >> word) {
    double number = 0;
    if (word == name && file >> number) return number;
  }
  return std::nullopt;
}

// The number of a line "NAME:  1234 kB" of the file, MiB; absent without such a line.
std::optional<double> Mebibytes(const std::string& path, const std::string& name) {
  const std::optional<double> kib = NumberBehind(name + ":", path);
  if (!kib) return std::nullopt;
  return *kib / 1024;
}

// The number of bytes that the file contains; absent if it contains "max".
std::optional<double> BytesIn(const std::string& path) {
  std::ifstream file(path);
  double bytes = 0;
  if (file >> bytes) return bytes;
  return std::nullopt;
}

// The memory that the control group of the process has left of its limit, MiB; version 2 or 1 of
// the interface. A container sees its own group at the root. Files that are kept from reading count
// as used, but make room where it is needed.
std::optional<double> LeftOfControlGroupMib(const std::string& root) {
  const std::string base = root + "/sys/fs/cgroup";
  std::vector<std::string> folders = {base, base + "/memory"};
  std::ifstream groups(root + "/proc/self/cgroup");  // "0::/path", "7:memory:/path"
  for (std::string line; std::getline(groups, line);) {
    const std::string path = line.substr(std::min(line.rfind(':') + 1, line.size()));
    folders.push_back(base + path);
    folders.push_back(base + "/memory" + path);
  }
  std::optional<double> least;
  for (const std::string& folder : folders) {
    for (const auto& [limit, used] :
         {std::pair{"/memory.max", "/memory.current"},
          std::pair{"/memory.limit_in_bytes", "/memory.usage_in_bytes"}}) {
      const std::optional<double> most = BytesIn(folder + limit), now = BytesIn(folder + used);
      if (!most || !now) continue;
      double files = 0;
      for (const char* name : {"active_file", "inactive_file"})
        files += NumberBehind(name, folder + "/memory.stat").value_or(0);
      const double left_mib = std::max(0.0, *most - std::max(0.0, *now - files)) / (1 << 20);
      least = std::min(least.value_or(left_mib), left_mib);
    }
  }
  return least;
}

std::optional<double> LeftOfAddressSpaceMib(const std::string& root) {
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return std::nullopt;
  const double limit_mib = static_cast<double>(limit.rlim_cur) / (1 << 20);
  const double used_mib = Mebibytes(root + "/proc/self/status", "VmSize").value_or(0);
  return std::max(0.0, limit_mib - used_mib);
}

}  // namespace

std::optional<double> MemoryLeftMib(const std::string& root) {
  std::optional<double> least = Mebibytes(root + "/proc/meminfo", "MemAvailable");
  for (const auto& left : {LeftOfControlGroupMib(root), LeftOfAddressSpaceMib(root)}) {
    if (left) least = std::min(least.value_or(*left), *left);
  }
  return least;
}

std::optional<double> UsualMemoryLimitMib(const std::string& root) {
  constexpr double kShare = 0.8;
  std::optional<double> available = Mebibytes(root + "/proc/meminfo", "MemAvailable");
  if (!available) return std::nullopt;
  if (const auto left = LeftOfControlGroupMib(root)) available = std::min(*available, *left);
  return kShare * *available + Mebibytes(root + "/proc/self/status", "VmRSS").value_or(0);
}

void ReturnMemoryAtOnce() {
#ifdef __GLIBC__
  constexpr int kBytes = 1 << 20;
  mallopt(M_MMAP_THRESHOLD, kBytes);
  mallopt(M_TRIM_THRESHOLD, kBytes);
  mallopt(M_TOP_PAD, kBytes);
#endif
}

}  // namespace thicklens
