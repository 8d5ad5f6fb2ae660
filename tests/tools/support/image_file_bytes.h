#ifndef THICKLENS_TESTS_TOOLS_SUPPORT_IMAGE_FILE_BYTES_H_
#define THICKLENS_TESTS_TOOLS_SUPPORT_IMAGE_FILE_BYTES_H_

#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

namespace thicklens::tools {

// The bytes of a file as OpenCV writes it, ".png" for example.
inline std::string Encoded(const cv::Mat& image, const std::string& extension,
                           const std::vector<int>& settings = {}) {
  std::vector<unsigned char> bytes;
  cv::imencode(extension, image, bytes, settings);
  return {bytes.begin(), bytes.end()};
}

}  // namespace thicklens::tools

#endif  // THICKLENS_TESTS_TOOLS_SUPPORT_IMAGE_FILE_BYTES_H_
