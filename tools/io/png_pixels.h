#ifndef THICKLENS_TOOLS_IO_PNG_PIXELS_H_
#define THICKLENS_TOOLS_IO_PNG_PIXELS_H_

#include <opencv2/core/mat.hpp>
#include <string>

namespace thicklens::io {

// Decodes the pixels of a PNG file as they are stored, with libspng: 8 or 16 bits (fewer are spread
// over 8); 1, 2 (grey with alpha), 3 (RGB) or 4 channels (RGBA: also for images other than grey
// with a transparent colour). Empty if they cannot be decoded; `why` then gets the reason. Throws
// std::bad_alloc if memory is short.
cv::Mat DecodePngPixels(const std::string& bytes, std::string* why);

enum class PngPacking {
  kFast,         // for noise, which stronger compression hardly makes smaller
  kRepetitions,  // for flat areas
  kSmall,        // the strongest compression
};

// Encodes 8 or 16 bits; 1, 3 (RGB) or 4 (RGBA) channels. Throws std::bad_alloc if memory is short,
// and Error if libspng fails otherwise.
std::string EncodePngPixels(const cv::Mat& image, PngPacking packing);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_PNG_PIXELS_H_
