#ifndef THICKLENS_TOOLS_IO_PNM_PIXELS_H_
#define THICKLENS_TOOLS_IO_PNM_PIXELS_H_

#include <string>

#include "thicklens/io/image_file.h"

namespace thicklens::io {

// Decodes PBM, PGM and PPM files, as text or binary, and PAM. (OpenImageIO 2.4 changes their
// values: it makes 65534 of 65535.) Throws Error without the file's name.
DecodedImage DecodePnm(const std::string& bytes, bool spread_bits);
// Decodes a PFM file of one or three channels, rows top to bottom. The values are those of the
// file: a scale other than 1 is a note. Throws Error.
DecodedImage DecodePfmImage(const std::string& bytes);

// Encodes 8 or 16 bits, 1 or 3 channels.
std::string EncodePnm(const cv::Mat& pixels);
// Encodes floats, 1 or 3 channels, little endian.
std::string EncodePfmImage(const cv::Mat& pixels);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_PNM_PIXELS_H_
