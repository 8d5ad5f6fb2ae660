#ifndef THICKLENS_TOOLS_OPENCV_CODECS_H_
#define THICKLENS_TOOLS_OPENCV_CODECS_H_

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

namespace thicklens::tools {

// OpenCV's decoders and encoders of picture files. They are in a library of their own, which is
// loaded when a picture first asks for it: with the hundred libraries that it brings along, it
// takes 40 MB of memory, and longer than all else that the program does when it starts.
struct OpenCvCodecs {
  // Red first, 1 to 4 channels, unchanged and never turned. Empty if it cannot be decoded; `why`
  // then says what is known, or nothing.
  cv::Mat (*decode)(const std::string& bytes, std::string* why);
  // 8 bits, 1 or 3 channels, red first; empty if it cannot be encoded.
  std::vector<unsigned char> (*encode_jpeg)(const cv::Mat& picture, int quality);
};

// Throws Error if that library is not where the program was installed. Read by many threads.
const OpenCvCodecs& LoadedOpenCvCodecs();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPENCV_CODECS_H_
