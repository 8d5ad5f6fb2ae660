#ifndef THICKLENS_TOOLS_SYSTEM_TEMPORARY_FOLDER_H_
#define THICKLENS_TOOLS_SYSTEM_TEMPORARY_FOLDER_H_

#include <filesystem>
#include <string>

#include "thicklens/base/temporaries.h"

namespace thicklens::tools {

// A new folder below TMPDIR, removed at the end with everything in it.
class TemporaryFolder {
 public:
  // The folder is named "thicklens-PURPOSE-XXXXXX". Throws Error that names TMPDIR.
  explicit TemporaryFolder(const std::string& purpose);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  static std::string NewFolder(const std::string& purpose);

  Temporary temporary_;
  std::filesystem::path path_;
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_SYSTEM_TEMPORARY_FOLDER_H_
