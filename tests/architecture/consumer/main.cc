#include <cmath>
#include <cstdio>
#include <opencv2/core/mat.hpp>
#include <string>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/estimator/estimate_input.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/thick_lens.h"

namespace {

bool Fail(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  return false;
}

bool LensIsRight() {
  thicklens::model::ThickLens lens;
  lens.front_focal_length_mm = 50;
  lens.rear_focal_length_mm = 50;
  lens.lens_thickness_mm = 5;
  lens.aperture_radius_mm = 10;
  // D = 105 - 5 = 100 = 2 f, so that the plane in focus is at 2 f, too.
  const double focus_depth_mm = thicklens::model::FocusDepthMm(lens, 105);
  return std::abs(focus_depth_mm - 100) < 1e-9 ||
         Fail("focus depth " + std::to_string(focus_depth_mm) + " mm, not 100");
}

// This function is from calib, so the linker has to find everything that calib uses internally.
bool OptionsAreValid() {
  const thicklens::calib::CalibrationOptions options;
  std::string why;
  return options.IsValid(&why) || Fail("default options: " + why);
}

// Reads a bitmap of one blue pixel, which is decoded by the library beside the installed program. A
// package without GPL parts says that it has none.
bool BitmapIsRead() {
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
    return Fail("a bitmap was read without GPL parts");
  }
  const cv::Mat image = thicklens::io::DecodeImage(bitmap, "one pixel");
  const auto pixel = image.at<cv::Vec3b>(0, 0);
  return (pixel[0] == 0 && pixel[2] == 255) || Fail("the pixel is not blue");
}

// Warps the photograph by its depth, writes the light field to a folder and reads it again.
bool LightFieldIsWritten() {
  thicklens::estimator::EstimateInput input;
  input.image = {8, 8, 1, std::vector<float>(64, 0.5F)};
  input.disparity.width_px = input.disparity.height_px = 8;
  input.disparity.disparity.assign(64, 0.5F);
  input.weights = Eigen::ArrayXXd::Constant(3, 3, 1.0 / 9);
  const auto light_field = thicklens::estimator::WarpedLightField(input, true, 1);
  thicklens::OutputFolder folder("light_field", thicklens::io::kLightFieldMarker,
                                 thicklens::io::LightFieldEntries());
  thicklens::io::WriteLightField(light_field, thicklens::io::ViewFormat::kPng, &folder);
  folder.Commit();
  const auto read = thicklens::io::ReadLightField("light_field", {});
  return (read.u_count == 3 && read.v_count == 3) || Fail("not all views were read");
}

}  // namespace

int main() {
  try {
    return LensIsRight() && OptionsAreValid() && BitmapIsRead() && LightFieldIsWritten() ? 0 : 1;
  } catch (const thicklens::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
