// The library that opencv_codecs.h describes. No other part of the program may include imgcodecs.
#include <cstddef>
#include <limits>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "tools/io/opencv_codecs.h"

namespace thicklens::io {
namespace {

// OpenCV stores colours as BGR, the project as RGB. Pixel types that are not swapped here are
// rejected later by their type.
cv::Mat SwapRedAndBlue(const cv::Mat& image) {
  const int channels = image.channels(), depth = image.depth();
  const bool has_colours = channels == 3 || channels == 4;
  const bool is_known = depth == CV_8U || depth == CV_16U || depth == CV_32F;
  if (image.empty() || !has_colours || !is_known) return image;
  cv::Mat swapped;
  cv::cvtColor(image, swapped, channels == 3 ? cv::COLOR_BGR2RGB : cv::COLOR_BGRA2RGBA);
  return swapped;
}

cv::Mat Decode(const std::string& bytes, std::string* why) {
  if (bytes.size() > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
    *why = "it is larger than the 2 GiB that OpenCV decodes";
    return {};
  }
  try {
    // "Unchanged" also means that an EXIF orientation is not applied: the principal point refers to
    // the pixels as the sensor stored them.
    const cv::Mat buffer(1, static_cast<int>(bytes.size()), CV_8U,
                         const_cast<char*>(bytes.data()));  // NOLINT: imdecode only reads
    return SwapRedAndBlue(cv::imdecode(buffer, cv::IMREAD_UNCHANGED));
  } catch (const cv::Exception& error) {
    *why = error.err;  // for example, OpenCV was built, or started, without EXR
    return {};
  }
}

std::vector<unsigned char> EncodeJpeg(const cv::Mat& image, int quality) {
  std::vector<unsigned char> bytes;
  const bool done =
      cv::imencode(".jpg", SwapRedAndBlue(image), bytes, {cv::IMWRITE_JPEG_QUALITY, quality});
  return done ? bytes : std::vector<unsigned char>();
}

}  // namespace
}  // namespace thicklens::io

extern "C" __attribute__((visibility("default"))) const thicklens::io::OpenCvCodecs*
ThicklensOpenCvCodecs() {
  static const thicklens::io::OpenCvCodecs codecs{thicklens::io::Decode, thicklens::io::EncodeJpeg};
  return &codecs;
}
