#include "tools/system/temporary_folder.h"

#include <fmt/format.h>

#include <cstdlib>
#include <system_error>

#include "thicklens/base/error.h"

namespace thicklens::tools {

namespace fs = std::filesystem;

TemporaryFolder::TemporaryFolder(const std::string& purpose)
    : temporary_([&] { return NewFolder(purpose); }), path_(temporary_.path()) {}

std::string TemporaryFolder::NewFolder(const std::string& purpose) {
  std::error_code failure;
  fs::path parent = fs::temp_directory_path(failure);
  // An absolute path is valid later, even if the current folder has changed by then.
  if (!failure) parent = fs::canonical(parent, failure);
  std::string name = (parent / ("thicklens-" + purpose + "-XXXXXX")).string();
  if (failure || mkdtemp(name.data()) == nullptr) {
    const char* value = std::getenv("TMPDIR");  // NOLINT: nothing sets it meanwhile
    throw Error(
        fmt::format("TMPDIR: no folder for temporary files can be created in '{}'; it must name a "
                    "folder where this is possible",
                    !failure           ? parent.string()
                    : value == nullptr ? ""
                                       : value));
  }
  return name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace thicklens::tools
