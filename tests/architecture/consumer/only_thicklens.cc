// A program that links thicklens::thicklens and no other library of the package by name.
#include <cstdio>

#include "thicklens/thicklens.h"

#ifdef OPENCV_CORE_MAT_HPP
#error "thicklens/thicklens.h includes OpenCV; thicklens/opencv.h is the header that may"
#endif

namespace {

// The exceptions of the interface are caught by their own type and by the base library's.
bool Works() {
  try {
    thicklens::ReadCamera("no such file");
    return false;
  } catch (const thicklens::Error&) {
  }
  thicklens::RunControl run;
  run.threads = -1;
  try {
    thicklens::EstimateLightField(thicklens::Image(), thicklens::DepthMap(), thicklens::Camera(),
                                  thicklens::EstimateOptions(), run);
  } catch (const thicklens::OptionError& error) {
    return error.field() == "threads";
  }
  return false;
}

}  // namespace

int main() {
  if (Works()) return 0;
  std::fprintf(stderr, "thicklens::thicklens does not work\n");
  return 1;
}
