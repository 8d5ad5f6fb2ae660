#ifndef THICKLENS_TESTS_SUPPORT_PART_OF_H_
#define THICKLENS_TESTS_SUPPORT_PART_OF_H_

#include <filesystem>
#include <string>
#include <system_error>

namespace thicklens::testing {

// Returns the path ".NAME.RANDOM.part" at which the output NAME of that folder is being made, or an
// empty path if there is none.
inline std::string PartOf(const std::string& folder, const std::string& name) {
  std::error_code failure;
  for (std::filesystem::directory_iterator entry(folder, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    const std::string found = entry->path().filename().string();
    if (found.rfind("." + name + ".", 0) == 0 && entry->path().extension() == ".part")
      return entry->path().string();
  }
  return "";
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_SUPPORT_PART_OF_H_
