#include "model/simulate/simulated_camera.h"

#include <fmt/format.h>

#include <cmath>

#include "thicklens/base/validity.h"

namespace thicklens::model {

bool IsSimulatable(const Camera& camera, std::string* why) {
  std::string inner;
  if (!camera.IsValid(&inner)) return Fail(why, "camera: " + inner);
  const auto missing = [&](const char* field) {
    return Fail(why, fmt::format("camera '{}': {} is missing: a simulation needs its true value",
                                 camera.name, field));
  };
  if (camera.distortion) {
    return Fail(why, fmt::format("camera '{}': lens.distortion is not simulated: the camera of a "
                                 "simulation must not state it",
                                 camera.name));
  }
  if (!camera.calibration || !camera.calibration->image_distance_mm) {
    return missing("image_distance_mm");
  }
  if (!camera.calibration->blur_ratio) return missing("blur_ratio");
  if (!std::isfinite(camera.focus_depth_mm())) {
    return Fail(why,
                fmt::format("camera '{}' is focused at infinity: a simulation needs a finite plane "
                            "of focus, where views have their samples, and a bench its scale "
                            "and light",
                            camera.name));
  }
  return true;
}

void TakeOutDistortion(Camera* camera, std::vector<std::string>* notices) {
  if (!camera->distortion) return;
  camera->distortion.reset();
  if (camera->calibration) camera->calibration->evidence.undistorted = false;
  notices->push_back(
      fmt::format("camera '{}': lens.distortion is not simulated: the images are those of the same "
                  "lens without distortion, and their camera file states none",
                  camera->name));
}

}  // namespace thicklens::model
