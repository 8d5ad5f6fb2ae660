#ifndef THICKLENS_TOOLS_REPORT_FOLDER_H_
#define THICKLENS_TOOLS_REPORT_FOLDER_H_

#include <filesystem>
#include <string>

namespace thicklens::tools {

// A folder that is made if it is missing, and goes again if nothing came into it.
class ReportFolder {
 public:
  explicit ReportFolder(const std::string& path);  // empty: none. Throws Error
  ~ReportFolder();
  ReportFolder(const ReportFolder&) = delete;
  ReportFolder& operator=(const ReportFolder&) = delete;

 private:
  std::filesystem::path path_;
  bool made_ = false;
};

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_FOLDER_H_
