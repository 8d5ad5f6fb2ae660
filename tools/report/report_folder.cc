#include "tools/report/report_folder.h"

#include <fmt/format.h>

#include <fstream>
#include <system_error>

#include "thicklens/base/error.h"
#include "tools/report/page_style.h"

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

void RequireOwnPage(const std::string& path, const std::string& kind) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored))
    return;  // what else it may be is checked where it is claimed
  constexpr std::streamsize kBytesOfHead = 1024;
  std::string head(kBytesOfHead, ' ');
  // ReadWholeFile would report the page as an input, which no output may replace.
  std::ifstream file(path, std::ios::binary);
  file.read(head.data(), kBytesOfHead);
  if (head.find(GeneratorTag(kind)) != std::string::npos) return;
  // An estimate's page of an earlier version has no such tag; its style sheet begins so. That of a
  // calibration had another name.
  const bool has_tag = head.find("name=\"generator\"") != std::string::npos;
  if (kind == kLightFieldPage && !has_tag &&
      head.find(":root { color-scheme: light dark; --paper: #ffffff;") != std::string::npos)
    return;
  throw Error(
      fmt::format("{}: this file is not the page of a {} by thicklens, and would be replaced: "
                  "name another folder, or remove it",
                  path, kind));
}

ReportFolder::~ReportFolder() {
  std::error_code not_empty;
  if (!made_.path().empty()) fs::remove(path_, not_empty);
}

}  // namespace thicklens::tools
