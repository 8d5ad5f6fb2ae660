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

}  // namespace thicklens::model
