// A blur floor of another calibration: it is copied to a sweep and compared with the sweep's
// camera.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "thicklens/base/error.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::model {

void TakeFloorOfCalibration(const std::string& camera_path, const std::string& place,
                            SweepFile* sweep) {
  Camera camera;
  try {
    camera = ReadCamera(camera_path);
  } catch (const Error& error) {
    throw Error(place + error.what());
  }
  if (!camera.calibration) {
    throw Error(fmt::format(
        "{}{} contains no calibration: a camera that thicklens calibrate has written is expected",
        place, camera_path));
  }
  const std::string& method = camera.calibration->evidence.method;
  if (method == "assumed" || method == "source-recipe") {
    throw Error(
        fmt::format("{}{}: calibration.evidence.method is '{}', which does not measure the blur "
                    "floor: calibrate on a sweep of a knife edge",
                    place, camera_path, method));
  }
  if (!camera.calibration->blur_floor_px) {
    throw Error(
        fmt::format("{}{} contains no calibration.blur_floor_px, because its sweep did not "
                    "determine the floor: calibrate on a sweep of a knife edge",
                    place, camera_path));
  }
  sweep->floor = {};
  sweep->floor.given_px = *camera.calibration->blur_floor_px;
  sweep->floor_origin = FloorOrigin{place, camera_path, camera.lens, camera.sensor.pixel_pitch_mm};
}

void RequireFloorOfCamera(const SweepFile& sweep, const Camera& camera) {
  if (!sweep.floor_origin) return;
  const FloorOrigin& origin = *sweep.floor_origin;
  const auto require_same = [&](const char* field, double theirs, double ours) {
    // Both files may contain the same number with different digits.
    if (std::abs(theirs - ours) <= 1e-6 * std::max(std::abs(theirs), std::abs(ours))) return;
    throw Error(
        fmt::format("{}{} has {} {}, but the camera '{}' of this sweep has {}: a blur floor is "
                    "valid only for the same lens, aperture and pixel pitch",
                    origin.place, origin.camera_path, field, theirs, camera.name, ours));
  };
  const ThickLens& a = origin.lens;
  const ThickLens& b = camera.lens;
  require_same("lens.front_focal_length_mm", a.front_focal_length_mm, b.front_focal_length_mm);
  require_same("lens.rear_focal_length_mm", a.rear_focal_length_mm, b.rear_focal_length_mm);
  require_same("lens.lens_thickness_mm", a.lens_thickness_mm, b.lens_thickness_mm);
  require_same("lens.aperture_radius_mm", a.aperture_radius_mm, b.aperture_radius_mm);
  require_same("sensor.pixel_pitch_mm", origin.pixel_pitch_mm, camera.sensor.pixel_pitch_mm);
}

}  // namespace thicklens::model
