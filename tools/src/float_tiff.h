#ifndef THICKLENS_TOOLS_FLOAT_TIFF_H_
#define THICKLENS_TOOLS_FLOAT_TIFF_H_

#include <string>

#include "thicklens/model/scene.h"

namespace thicklens::tools {

// A TIFF file of 32-bit floats, 1 (grey) or 3 (RGB) channels, without compression: the noise of
// floats hardly gets smaller. Written from the picture's own memory. Throws Error with the name to
// be shown if it cannot be written, or is beyond the 4 GiB that such a file can hold.
void WriteFloatTiff(const model::LinearPicture& picture, const std::string& path,
                    const std::string& shown_name);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_FLOAT_TIFF_H_
