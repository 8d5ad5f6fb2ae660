#include "tools/io/light_field_camera.h"

#include <fmt/format.h>

#include <filesystem>

#include "thicklens/base/error.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/camera_file.h"

namespace thicklens::io {

namespace fs = std::filesystem;

std::optional<model::Camera> CameraOfLightField(const std::string& folder,
                                                const model::LightFieldDescription& description) {
  if (description.camera_file.empty()) return std::nullopt;
  const std::string path = (fs::path(folder) / description.camera_file).string();
  model::Camera camera = model::ReadCamera(path);
  const model::LightField& frame = description.light_field;
  const model::Sensor& sensor = camera.sensor;
  if (sensor.width_px != frame.s_count || sensor.height_px != frame.t_count) {
    throw Error(fmt::format(
        "{}: its sensor has {}x{} px, the views of {} have {}x{}: the sizes must be equal", path,
        sensor.width_px, sensor.height_px, (fs::path(folder) / kLightFieldMarker).string(),
        frame.s_count, frame.t_count));
  }
  return camera;
}

std::string WriteCameraOfLightField(const model::LightField& light_field, OutputFolder* folder) {
  if (!light_field.camera) return "";
  // The weights of the views state the aperture.
  folder->Write(kLightFieldCameraFile,
                model::CameraToYaml(model::WithoutMeasuredPsf(*light_field.camera)));
  return kLightFieldCameraFile;
}

}  // namespace thicklens::io
