#ifndef THICKLENS_TOOLS_IO_IMAGE_NAMES_H_
#define THICKLENS_TOOLS_IO_IMAGE_NAMES_H_

#include <string>
#include <vector>

namespace thicklens::io {

// Whether the name ends like that of an image file.
bool IsImageName(const std::string& name);
// Names of the image files that are directly in a folder, sorted. Hidden files are left out. Throws
// Error if the folder cannot be read.
std::vector<std::string> ImageNames(const std::string& folder);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_IMAGE_NAMES_H_
