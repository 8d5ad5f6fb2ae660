#ifndef THICKLENS_DEPTH_FIT_H_
#define THICKLENS_DEPTH_FIT_H_

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/depth.h"
#include "thicklens/image.h"
#include "thicklens/model/lens_distortion.h"
#include "thicklens/model/light_field.h"
#include "thicklens/run.h"

namespace thicklens {

// A camera beside the photograph's that measured the depth map, and where it stands: a point X_d,
// mm, in the axes of the depth camera (x right, y down, z along its axis) is at
// X_p = rotation X_d + translation_mm in those of the photograph's camera. Both origins are the
// centres of the pinhole models. It is what OpenCV's stereoCalibrate returns with the depth camera
// as the first one.
struct DepthCamera {
  model::LensDistortion depth_lens;  // size, camera matrix and distortion of the depth camera
  model::LensDistortion photo_lens;  // and those of the photograph's camera
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  // from the depth camera's axes
  Eigen::Vector3d translation_mm{0, 0, 0};                 // of the depth camera's origin, mm
  std::string source;  // file that it was read from; messages name it

  // Returns whether both lenses are valid and the rotation is one. Otherwise `why`, if not null,
  // gets the field and what is wrong.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Reads the file of a depth camera (docs/file-formats.md, "Depth camera"). Throws Error that names
// file, line and field.
THICKLENS_EXPORT DepthCamera ReadDepthCamera(const std::string& path);

// Where the values of a smaller depth map were measured.
enum class DepthSamples {
  kAuto,    // at the centres, unless the photograph's edges show by four sigma that at the corners
  kCentre,  // at the centres of the map's pixels, as areas are averaged
  kCorner,  // at the top-left photograph pixels of the map's pixels, as every n-th pixel is taken
};

// How a depth map of another size, part or camera is brought to the pixels of its photograph.
struct DepthFit {
  // The rectangle of the photograph that the map shows, px. It may be larger than the photograph.
  // Absent: the whole photograph, or, for a map of another aspect ratio, the part whose edges agree
  // with those of the map if they show it by four sigma.
  std::optional<model::PixelRect> part;
  // Camera that measured the map; null: that of the photograph. Excludes `part`.
  std::shared_ptr<const DepthCamera> camera;
  DepthSamples samples = DepthSamples::kAuto;  // of a smaller map
  // A value whose confidence is below it is no depth; 0 to 1. A confidence of 0 never is one.
  double min_confidence = 0;

  // Returns whether the fields are valid. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Returns the map in the pixels of the photograph, with its confidence. Where the map has no value,
// the result has NaN. Between its samples the edges of the photograph decide where one surface ends
// and the next begins; no value appears between two surfaces. A larger map is reduced to the
// surface that fills most of each pixel. Lengths are interpolated as 1/z. `described` (may be null)
// gets one line about what was done. `run` gets it too. Throws Error, with what would help, if the
// part of the photograph that the map shows is neither stated nor found.
THICKLENS_EXPORT DepthMap FitDepth(DepthMap depth, const Image& photo, const DepthFit& fit = {},
                                   std::string* described = nullptr, const RunControl& run = {});

// Reads the confidence of a depth map, of its size, into DepthMap::confidence: one channel, like a
// depth map. `full_scale` is the value of full confidence; absent: the largest value of the file's
// integer type, or 1 of floats. What is not a number has confidence 0. A map whose rows or columns
// were reversed (DepthMap::flip) gets its confidence reversed alike. Throws Error that names the
// file: another size, negative values or values above full scale.
THICKLENS_EXPORT void ReadDepthConfidence(const std::string& path, std::optional<double> full_scale,
                                          DepthMap* depth);

}  // namespace thicklens

#endif  // THICKLENS_DEPTH_FIT_H_
