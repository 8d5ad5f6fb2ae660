#include "tools/report/report_folder.h"

#include <fmt/format.h>

#include <system_error>

#include "thicklens/base/error.h"

namespace thicklens::tools {

namespace fs = std::filesystem;

ReportFolder::ReportFolder(const std::string& path) : path_(path) {
  std::error_code failure;
  if (path == "-") throw Error("-: a report cannot be written to standard output; name a folder");
  if (path.empty() || fs::exists(path, failure)) return;
  bool is_new = false;  // another process may create it at the same moment
  made_ = Temporary(
      [&] {
        is_new = fs::create_directory(path, failure);
        if (failure)
          throw Error(fmt::format("{}: the folder cannot be created: {}", path, failure.message()));
        return path;
      },
      Abandon::kIfEmpty);
  if (!is_new) made_ = {};
}

ReportFolder::~ReportFolder() {
  std::error_code not_empty;
  if (!made_.path().empty()) fs::remove(path_, not_empty);
}

}  // namespace thicklens::tools
