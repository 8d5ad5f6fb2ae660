#ifndef THICKLENS_TOOLS_OPTIONS_EXIF_CHECK_H_
#define THICKLENS_TOOLS_OPTIONS_EXIF_CHECK_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "thicklens/io/exif.h"
#include "thicklens/model/camera.h"

namespace thicklens::tools {

// A calibration holds for one lens at one setting. A photograph's EXIF is therefore compared with
// the camera file.

enum class ExifVerdict {
  kAgrees,
  kUndecided,  // differs by no more than rounding and nominal values explain, or cannot be compared
  kContradicts,  // the photograph is of another lens, setting or sensor
};
std::string ExifVerdictName(ExifVerdict verdict);  // "agrees", "undecided", "contradicts"

// One quantity, with both values as text.
struct ExifFinding {
  std::string quantity;       // "focal length"
  std::string photo, camera;  // "35 mm", "50 +- 0.1 mm"
  ExifVerdict verdict = ExifVerdict::kAgrees;
  std::string remark;  // what a disagreement may mean
};

// Facts about the photograph besides its EXIF.
struct PhotoSize {
  int width_px = 0, height_px = 0;  // as stored
  bool is_part_of_sensor = false;   // --sensor-origin says which
};

// Compares both statements. Rules (docs/light-fields.md):
// - Focal length against front_focal_length_mm .. rear_focal_length_mm: half a unit of the last
//   digit of EXIF, and the camera file's tolerance. Without a stated tolerance EXIF's nominal value
//   may be 5 % off, which is undecided.
// - F-number against f1/(2 r): the same rounding and tolerances; up to 6 % beyond, half of a third
//   of a stop, is undecided.
// - Focus distance against zf (from the aperture) .. zf + d1 (from the sensor): 10 % and the
//   rounding; beyond a factor of 1.5 it contradicts.
// - 35 mm equivalent against the size of the sensor; pixel pitch; size of the image as made;
//   digital zoom; orientation.
std::vector<ExifFinding> CompareExif(const io::PhotoExif& exif, const model::Camera& camera,
                                     const PhotoSize& size);

// Reads the photograph's EXIF and compares it. Warns about undecided values. Throws Error with both
// values of everything that contradicts the camera; with `ignore` it reports them instead. It is
// silent without EXIF. Returns the part of --json about EXIF.
nlohmann::json RequireSameCamera(const std::string& photo_path, const std::string& camera_path,
                                 const model::Camera& camera, const PhotoSize& size, bool ignore);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_EXIF_CHECK_H_
