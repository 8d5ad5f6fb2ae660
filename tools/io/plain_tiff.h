#ifndef THICKLENS_TOOLS_IO_PLAIN_TIFF_H_
#define THICKLENS_TOOLS_IO_PLAIN_TIFF_H_

#include <cstdint>
#include <string>
#include <vector>

#include "thicklens/model/scene.h"

namespace thicklens::io {

// Each function writes a TIFF file of 1 (grey) or 3 (RGB) channels, the channels of a pixel
// together, without compression: noise hardly gets smaller by it. They throw Error with
// `shown_name` if the file cannot be written or exceeds the 4 GiB that such a file can hold.

// Writes 32-bit floats from the image's own memory.
void WriteFloatTiff(const model::LinearImage& image, const std::string& path,
                    const std::string& shown_name);
// Writes whole numbers of 16 bits; their count is that of the pixels and channels.
void WriteWholeTiff(const std::vector<std::uint16_t>& values, int width_px, int height_px,
                    int channels, const std::string& path, const std::string& shown_name);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_PLAIN_TIFF_H_
