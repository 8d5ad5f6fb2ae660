#ifndef THICKLENS_TOOLS_IO_JPEG_PIXELS_H_
#define THICKLENS_TOOLS_IO_JPEG_PIXELS_H_

#include <string>

#include "thicklens/io/image_file.h"

namespace thicklens::io {

// Decodes a JPEG file, grey or RGB, with libjpeg: OpenImageIO would decode the same pixels, but
// loads for 0.3 s. Throws Error without the file's name, also for files that end early or are
// damaged.
DecodedImage DecodeJpeg(const std::string& bytes);

// Encodes 8 bits, 1 or 3 channels.
std::string EncodeJpeg(const cv::Mat& pixels, const ImageWriting& writing);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_JPEG_PIXELS_H_
