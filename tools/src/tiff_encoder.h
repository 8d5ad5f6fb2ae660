#ifndef THICKLENS_TOOLS_TIFF_ENCODER_H_
#define THICKLENS_TOOLS_TIFF_ENCODER_H_

#include <string>

#include "thicklens/model/scene.h"

namespace thicklens::tools {

// A TIFF file (baseline of revision 6.0) of 32-bit floats without compression: the noise of floats
// hardly gets smaller. One copy of the values and nothing else is held. 1 (grey) or 3 (RGB)
// channels. Throws Error beyond the 4 GiB that such a file can hold.
std::string EncodeFloatTiff(const model::LinearPicture& picture);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_TIFF_ENCODER_H_
