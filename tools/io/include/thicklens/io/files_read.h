#ifndef THICKLENS_IO_FILES_READ_H_
#define THICKLENS_IO_FILES_READ_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/io/image_file.h"

namespace thicklens::io {

// Image files that were read alike: ImageFacts::OneLine says the same of each.
struct FilesRead {
  std::vector<std::string> files;  // paths, in the order of reading
  ImageFacts facts;                // of the first of them
};

// Groups files by what was read from them. `facts` has one entry for each path; files without facts
// were not read and are left out. The first group has the most files.
THICKLENS_EXPORT std::vector<FilesRead> GroupFilesRead(
    const std::vector<std::string>& paths, const std::vector<std::optional<ImageFacts>>& facts);

// Describes the groups in one line: "PNG, 640 x 480 px, .." for one file, "31 files: TIFF, .." for
// several, and "30 files: ..; f007.tif: .." if they differ.
THICKLENS_EXPORT std::string FilesReadLine(const std::vector<FilesRead>& groups);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_FILES_READ_H_
