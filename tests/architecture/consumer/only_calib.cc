// A program that links thicklens::calib and no other library of the package by name.
#include <cstdio>

#include "thicklens/calib/calibrate.h"

namespace {

bool Works() {
  const thicklens::calib::CalibrationOptions options;
  return options.IsValid(nullptr);
}

}  // namespace

int main() {
  if (Works()) return 0;
  std::fprintf(stderr, "thicklens::calib does not work\n");
  return 1;
}
