#ifndef THICKLENS_TOOLS_IMAGE_IO_H_
#define THICKLENS_TOOLS_IMAGE_IO_H_

#include <opencv2/core/mat.hpp>
#include <string>

#include "thicklens/model/scene.h"

namespace thicklens::tools {

// The picture in the bytes of a file, exactly as stored: 8 or 16 bit; 1, 3 (RGB) or 4 (RGBA)
// channels; never rotated. Throws Error that begins with `name`.
cv::Mat DecodePicture(const std::string& bytes, const std::string& name);
cv::Mat ReadPictureFile(const std::string& path);

model::StoredPicture ToStoredPicture(const cv::Mat& picture);
// The first three of four channels; others as they are. Alpha says nothing about light.
model::StoredPicture WithoutAlpha(const model::StoredPicture& picture);

// A PNG file of 1, 3 or 4 channels, 8 or 16 bit. Compressed lightly: the noise of a photograph
// hardly gets smaller, but takes much longer, by trying harder.
std::string EncodePng(const model::StoredPicture& picture);
// Bytes as they are, in one channel. Throws Error if they are not rows of that width.
std::string EncodeBytesPng(const std::vector<std::uint8_t>& bytes, int width_px);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_IMAGE_IO_H_
