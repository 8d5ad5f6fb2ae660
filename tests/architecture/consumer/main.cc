#include <cmath>
#include <cstdio>
#include <string>

#include "thicklens/calib/calibrate.h"
#include "thicklens/model/thick_lens.h"

int main() {
  thicklens::model::ThickLens lens;
  lens.front_focal_length_mm = 50;
  lens.rear_focal_length_mm = 50;
  lens.lens_thickness_mm = 5;
  lens.aperture_radius_mm = 10;
  // D = 105 - 5 = 100 = 2 f, so that the plane in focus is at 2 f, too.
  const double focus_depth_mm = thicklens::model::FocusDepthMm(lens, 105);
  if (!(std::abs(focus_depth_mm - 100) < 1e-9)) {
    std::fprintf(stderr, "focus depth %.17g mm, not 100\n", focus_depth_mm);
    return 1;
  }
  // From calib, so that everything it uses inside has to be found by the linker.
  const thicklens::calib::CalibrationOptions options;
  std::string why;
  if (!options.IsValid(&why)) {
    std::fprintf(stderr, "default options: %s\n", why.c_str());
    return 1;
  }
  return 0;
}
