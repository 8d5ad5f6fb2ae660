#include "thicklens/camera.h"

#include <fmt/format.h>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/distortion.h"
#include "thicklens/model/camera_file.h"

namespace thicklens {

Camera ReadCamera(const std::string& path) { return model::ReadCamera(path); }

void WriteCamera(const std::string& path, const Camera& camera) {
  std::string why;
  if (!camera.IsValid(&why)) throw Error("camera: " + why);
  WriteFileAtomically(path, model::CameraToYaml(camera));
}

std::vector<std::string> NoticesOf(const Camera& camera) {
  std::vector<std::string> notices = camera.notices;
  const std::vector<std::string> assumed = model::AssumedFields(camera);
  if (!assumed.empty()) {
    notices.push_back(
        fmt::format("camera '{}': assumed, neither published nor measured: {}; measure or look "
                    "them up and edit the camera file, or ignore this for a first try",
                    camera.name, fmt::join(assumed, ", ")));
  }
  const std::string doubt = DoubtOfDistortion(camera);
  if (!doubt.empty()) notices.push_back(fmt::format("camera '{}': {}", camera.name, doubt));
  return notices;
}

}  // namespace thicklens
