#ifndef THICKLENS_TOOLS_PNG_PIXELS_H_
#define THICKLENS_TOOLS_PNG_PIXELS_H_

#include <opencv2/core/mat.hpp>
#include <string>

namespace thicklens::tools {

// The pixels of a PNG file as they are stored, by libspng: 8 or 16 bits (fewer are spread over 8);
// 1, 3 (RGB) or 4 channels (RGBA: of grey with alpha as well, and where one of the colours, other
// than of greys, is called transparent). Empty if they cannot be decoded; `why` then says why.
cv::Mat DecodePngPixels(const std::string& bytes, std::string* why);

enum class PngPacking {
  kFast,         // of noise: what trying harder hardly makes smaller
  kRepetitions,  // of flat areas
  kSmall,        // as far as it goes
};

// 8 or 16 bits; 1, 3 (RGB) or 4 (RGBA) channels. Throws Error if there is no memory for it.
std::string EncodePngPixels(const cv::Mat& picture, PngPacking packing);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_PNG_PIXELS_H_
