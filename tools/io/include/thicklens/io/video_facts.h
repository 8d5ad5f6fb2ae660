#ifndef THICKLENS_IO_VIDEO_FACTS_H_
#define THICKLENS_IO_VIDEO_FACTS_H_

#include <optional>
#include <string>

namespace thicklens::io {

// The facts that a video states about all of its frames.
struct VideoFacts {
  std::string container;     // "MP4 or MOV", "Matroska or WebM", "AVI"
  std::string codec;         // "H.264", "Motion JPEG"
  std::string pixel_format;  // as FFmpeg names it: "yuv420p", "gray10le"
  // Whether the codec never loses anything: raw values, FFV1
  bool is_lossless = false;
  // Values of YUV: white is full scale, or 235 of 255 (black 16).
  bool is_full_range = false;
  bool is_range_stated = false;  // whether the file states it
  // The coefficients between YUV and RGB: "BT.709", "BT.601", "BT.2020"; empty: the values are grey
  // or RGB.
  std::string matrix;
  bool is_matrix_stated = false;  // whether the file states it
  // The samples of colour for 2 x 2 px: "4:2:0", "4:2:2", "4:4:4"; empty: grey or RGB.
  std::string chroma;
  double pixel_aspect = 1;  // width of a pixel over its height, as stated; 1 if it is not
};

// The amount of data of the compressed frames of a video, measured from all of them.
struct VideoCompression {
  double bits_per_pixel = 0;              // compressed bits of a frame over its pixels
  std::optional<double> bits_per_second;  // absent: the frames have no time stamps
};

}  // namespace thicklens::io

#endif  // THICKLENS_IO_VIDEO_FACTS_H_
