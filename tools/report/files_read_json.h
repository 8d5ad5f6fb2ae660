#ifndef THICKLENS_TOOLS_REPORT_FILES_READ_JSON_H_
#define THICKLENS_TOOLS_REPORT_FILES_READ_JSON_H_

#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "thicklens/io/files_read.h"

namespace thicklens::tools {

// Returns what --json writes under `read`: a list with one object per group of files that were read
// alike, with `files`, the text `line` and the facts by themselves.
nlohmann::json FilesReadJson(const std::vector<io::FilesRead>& groups);
// Likewise for one file; `facts` may be null.
nlohmann::json FileReadJson(const std::string& path, const io::ImageFacts* facts);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_FILES_READ_JSON_H_
