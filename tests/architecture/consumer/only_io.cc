// A program that links thicklens::io and no other library of the package by name.
#include <cstdio>
#include <opencv2/core/mat.hpp>
#include <string>

#include "thicklens/base/error.h"
#include "thicklens/io/image_io.h"

namespace {

// Reads a bitmap of one blue pixel, which is decoded by the library that the library loads. A
// package without GPL parts says that it has none.
bool Works() {
  const std::string bitmap(
      "BM\x3A\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\x01\0\0\0\x01\0\0\0\x01\0\x18\0"
      "\0\0\0\0\x04\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\xFF\0\0\0",
      58);
  if (HAS_GPL_PARTS == 0) {
    try {
      thicklens::io::DecodeImage(bitmap, "one pixel");
    } catch (const thicklens::Error& error) {
      return std::string(error.what()).find("THICKLENS_WITH_GPL=OFF") != std::string::npos;
    }
    return false;
  }
  const auto pixel = thicklens::io::DecodeImage(bitmap, "one pixel").at<cv::Vec3b>(0, 0);
  return pixel[0] == 0 && pixel[2] == 255;
}

}  // namespace

int main() {
  if (Works()) return 0;
  std::fprintf(stderr, "thicklens::io does not work\n");
  return 1;
}
