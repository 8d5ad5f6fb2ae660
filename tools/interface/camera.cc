#include "thicklens/camera.h"

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/model/camera_file.h"

namespace thicklens {

Camera ReadCamera(const std::string& path) { return model::ReadCamera(path); }

void WriteCamera(const std::string& path, const Camera& camera) {
  std::string why;
  if (!camera.IsValid(&why)) throw Error("camera: " + why);
  WriteFileAtomically(path, model::CameraToYaml(camera));
}

}  // namespace thicklens
