#ifndef THICKLENS_TOOLS_IO_LIBRARY_VIDEO_PIXELS_H_
#define THICKLENS_TOOLS_IO_LIBRARY_VIDEO_PIXELS_H_

extern "C" {
#include <libavutil/frame.h>
}

#include <cstdint>
#include <opencv2/core/mat.hpp>

#include "thicklens/io/image_file.h"

struct SwsContext;

namespace thicklens::io {

// Adds to the facts what the first decoded frame states of its values: type, channels, range,
// matrix, transfer. Throws Refusal for values that are not converted.
void DescribePixels(const AVFrame& frame, ImageFacts* facts);

// A hash of the values of the frame, before any conversion.
std::uint64_t DigestOfPixels(const AVFrame& frame);

// Makes grey or RGB, white at full scale of 8 or 16 bits, of the values of a frame.
class PixelConverter {
 public:
  PixelConverter() = default;
  ~PixelConverter();
  PixelConverter(const PixelConverter&) = delete;
  PixelConverter& operator=(const PixelConverter&) = delete;

  // `facts` are those of DescribePixels. Throws Refusal.
  cv::Mat Convert(const AVFrame& frame, const ImageFacts& facts);

 private:
  cv::Mat ConvertGrey(const AVFrame& frame, const ImageFacts& facts) const;

  SwsContext* context_ = nullptr;
};

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_LIBRARY_VIDEO_PIXELS_H_
