#ifndef THICKLENS_TOOLS_IO_FLOAT_TIFF_H_
#define THICKLENS_TOOLS_IO_FLOAT_TIFF_H_

#include <string>

#include "thicklens/model/scene.h"

namespace thicklens::io {

// Writes a TIFF file of 32-bit floats, 1 (grey) or 3 (RGB) channels, from the image's own memory.
// It is not compressed: the noise of floats hardly gets smaller. Throws Error with `shown_name` if
// the file cannot be written or exceeds the 4 GiB that such a file can hold.
void WriteFloatTiff(const model::LinearImage& image, const std::string& path,
                    const std::string& shown_name);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_FLOAT_TIFF_H_
