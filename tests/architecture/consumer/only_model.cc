// A program that links thicklens::model and no other library of the package by name.
#include <cstdio>

#include "thicklens/model/thick_lens.h"

namespace {

// D = 105 - 5 = 100 = 2 f, so that the plane in focus is at 2 f, too.
bool Works() {
  thicklens::model::ThickLens lens;
  lens.front_focal_length_mm = lens.rear_focal_length_mm = 50;
  lens.lens_thickness_mm = 5;
  lens.aperture_radius_mm = 10;
  const double focus_depth_mm = thicklens::model::FocusDepthMm(lens, 105);
  return focus_depth_mm > 99.999 && focus_depth_mm < 100.001;
}

}  // namespace

int main() {
  if (Works()) return 0;
  std::fprintf(stderr, "thicklens::model does not work\n");
  return 1;
}
