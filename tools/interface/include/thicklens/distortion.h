#ifndef THICKLENS_DISTORTION_H_
#define THICKLENS_DISTORTION_H_

#include <cstddef>
#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/camera.h"
#include "thicklens/depth.h"
#include "thicklens/image.h"
#include "thicklens/model/lens_distortion.h"
#include "thicklens/run.h"

namespace thicklens {

// Where a lens images points: OpenCV's perspective model with 4 to 14 coefficients, or its fisheye
// model (thicklens/model/lens_distortion.h). Camera::distortion is one.
using LensDistortion = model::LensDistortion;

// Reads the lens distortion of "FILE" or "FILE:CAMERA": OpenCV (YAML, XML, JSON), ROS camera_info,
// Kalibr camchain, COLMAP cameras.txt and cameras.bin, mrcal .cameramodel, or a camera file of this
// project. A file that states no size of its photographs takes `width_px` and `height_px`, which a
// notice says; 0: it must state it. Throws Error that names file and field.
THICKLENS_EXPORT LensDistortion ReadLensDistortion(const std::string& file_and_camera,
                                                   int width_px = 0, int height_px = 0,
                                                   const RunControl& run = {});

// Returns what contradicts that the camera's distortion is of its lens: another focal length, in
// px. Empty: nothing does, or the camera states no distortion.
THICKLENS_EXPORT std::string DoubtOfDistortion(const Camera& camera);

// Returns the image, in linear light, that a lens without the distortion would have made: of the
// same size and camera matrix. The distortion is scaled to the image. Encoded values are decoded by
// the image's transfer curve, by the one that its file states, or by sRGB; transfer() of the result
// is this curve. A pixel that the image does not show is 0; `without_source`, if not null, gets
// their number. Throws Error for a distortion that is not valid or of another aspect ratio.
THICKLENS_EXPORT Image UndistortImage(const Image& image, const LensDistortion& distortion,
                                      std::size_t* without_source = nullptr);
// Likewise a depth map, which takes the nearest value, so that none appears between two surfaces. A
// pixel that the map does not show is a hole (NaN).
THICKLENS_EXPORT DepthMap UndistortDepth(const DepthMap& depth, const LensDistortion& distortion,
                                         std::size_t* without_source = nullptr);

// The options of UndistortFile.
struct UndistortFileOptions {
  bool is_depth = false;  // the file is a depth map
  // Transfer curve of an image of integers; absent: the one that the file states, or sRGB.
  std::optional<TransferCurve> transfer;
  // Transfer curve of an image whose file states none, in place of sRGB.
  std::optional<TransferCurve> assumed_transfer;
};
// A file whose image was undistorted.
struct UndistortedFile {
  std::string bytes;   // of a file of the same kind and type of values, if that kind is lossless
  std::string ending;  // of its name, such as ".png": a JPEG or raw file becomes PNG
  int width_px = 0, height_px = 0;  // size, px
  std::size_t without_source = 0;   // number of pixels
  std::string values;               // "unsigned 16-bit integers"
  std::string remark;               // what a user should know; empty: nothing
};
// Reads an image or a depth map and returns it undistorted. Integers of 8 and 16 bits and floats
// keep their type. Images of integers are interpolated in linear light. Pixels without a source are
// 0, in a depth map of floats NaN. Throws Error that names the file.
THICKLENS_EXPORT UndistortedFile UndistortFile(const std::string& path,
                                               const LensDistortion& distortion,
                                               const UndistortFileOptions& options = {});

}  // namespace thicklens

#endif  // THICKLENS_DISTORTION_H_
