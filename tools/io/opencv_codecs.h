#ifndef THICKLENS_TOOLS_IO_OPENCV_CODECS_H_
#define THICKLENS_TOOLS_IO_OPENCV_CODECS_H_

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

namespace thicklens::io {

// OpenCV's decoders and encoders of image files. They are in a library of their own, which is
// loaded when an image first needs it: with the hundred libraries that it depends on, it takes 40
// MB of memory, and more time than everything else that the program does at its start.
struct OpenCvCodecs {
  // Red first, 1 to 4 channels, unchanged and never rotated. Empty if the bytes cannot be decoded;
  // `why` then gets the reason if it is known.
  cv::Mat (*decode)(const std::string& bytes, std::string* why);
  // 8 bits, 1 or 3 channels, red first; empty if the image cannot be encoded.
  std::vector<unsigned char> (*encode_jpeg)(const cv::Mat& image, int quality);
};

// Throws Error if that library is missing from the program's installation. Many threads may call
// it.
const OpenCvCodecs& LoadedOpenCvCodecs();

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_OPENCV_CODECS_H_
