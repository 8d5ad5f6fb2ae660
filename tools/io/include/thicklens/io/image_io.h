#ifndef THICKLENS_IO_IMAGE_IO_H_
#define THICKLENS_IO_IMAGE_IO_H_

#include <opencv2/core/mat.hpp>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/io/image_file.h"
#include "thicklens/model/scene.h"

namespace thicklens::io {

// The narrow door for photographs: decodes what DecodeImageFile reads if it has 8 or 16 bits and 1,
// 3 (RGB) or 4 (RGBA) channels. It is never rotated; values of fewer bits are spread; grey with
// alpha becomes RGBA; raw files are demosaiced. `facts`, if not null, gets what the file states.
// Throws Error that begins with `name`.
THICKLENS_EXPORT cv::Mat DecodeImage(const std::string& bytes, const std::string& name,
                                     ImageFacts* facts = nullptr);
// Likewise, with choices of how it is read.
THICKLENS_EXPORT cv::Mat DecodeImage(const std::string& bytes, const std::string& name,
                                     const ImageReading& reading, ImageFacts* facts);
// Reads the file and decodes it as DecodeImage does. Throws Error that names the path.
THICKLENS_EXPORT cv::Mat ReadImageFile(const std::string& path, ImageFacts* facts = nullptr);
// Throws Error if the library that reads and writes all kinds but PNG, TIFF, JPEG, PNM and PFM is
// missing from the program's installation. A build without GPL parts does not need it.
THICKLENS_EXPORT void RequireImageCodecs();
// The kinds of files that this build reads, in words.
THICKLENS_EXPORT std::string ReadableImageKinds();

// Copies the values of a matrix as ReadImageFile returns it.
THICKLENS_EXPORT model::EncodedImage ToEncodedImage(const cv::Mat& image);
// Returns the first three of four channels, and other images unchanged: alpha contains no light.
THICKLENS_EXPORT model::EncodedImage WithoutAlpha(const model::EncodedImage& image);

// Encodes a PNG file of 1, 3 or 4 channels, 8 or 16 bit. The compression is light: a stronger one
// takes much longer and hardly makes the noise of a photograph smaller.
THICKLENS_EXPORT std::string EncodePng(const model::EncodedImage& image,
                                       const std::string& icc_profile = "");
// Encodes bytes unchanged in one channel. Throws Error if they are not rows of that width.
THICKLENS_EXPORT std::string EncodeBytesPng(const std::vector<std::uint8_t>& bytes, int width_px);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_IMAGE_IO_H_
