#ifndef THICKLENS_IO_DEPTH_IO_H_
#define THICKLENS_IO_DEPTH_IO_H_

#include <string>

#include "thicklens/base/export.h"
#include "thicklens/model/scene.h"

namespace thicklens::io {

// Reads a depth map of one channel: PFM (grey, either byte order, rows bottom to top as the format
// has them), 8- or 16-bit PNG, 16-bit or float TIFF, float EXR. The rows of the result go top to
// bottom. Throws Error that names the file, what was found and what is expected (for three
// channels, a file that is no image, a broken header, missing values).
THICKLENS_EXPORT model::RawDepthMap ReadDepthMap(const std::string& path);

// Encodes the map as a PFM file (little endian).
THICKLENS_EXPORT std::string EncodePfm(const model::RawDepthMap& map);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_DEPTH_IO_H_
