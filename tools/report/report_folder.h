#ifndef THICKLENS_TOOLS_REPORT_REPORT_FOLDER_H_
#define THICKLENS_TOOLS_REPORT_REPORT_FOLDER_H_

#include <filesystem>
#include <string>

#include "thicklens/base/temporaries.h"

namespace thicklens::tools {

// A folder that is created if it is missing, and removed again if nothing was written into it, even
// if the process is interrupted.
class ReportFolder {
 public:
  explicit ReportFolder(const std::string& path);  // empty: none. Throws Error
  ~ReportFolder();
  ReportFolder(const ReportFolder&) = delete;
  ReportFolder& operator=(const ReportFolder&) = delete;

 private:
  std::filesystem::path path_;
  Temporary made_;  // the folder, if this run created it
};

// Throws Error if there is a file at `path` that is no page of this kind by this program, because
// it would be replaced. `kind` is one of page_style.h.
void RequireOwnPage(const std::string& path, const std::string& kind);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_REPORT_FOLDER_H_
