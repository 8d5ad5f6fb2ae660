#ifndef THICKLENS_TOOLS_IO_LIGHT_FIELD_CAMERA_H_
#define THICKLENS_TOOLS_IO_LIGHT_FIELD_CAMERA_H_

#include <optional>
#include <string>

#include "thicklens/base/output_file.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/light_field_file.h"

namespace thicklens::io {

// Reads the camera file of a light field's folder; absent if its description names none. Throws
// Error if the camera's sensor has another size than the views.
std::optional<model::Camera> CameraOfLightField(const std::string& folder,
                                                const model::LightFieldDescription& description);

// Writes the camera of a light field into its folder. Returns the name of the file for the
// description; empty: there is no camera.
std::string WriteCameraOfLightField(const model::LightField& light_field, OutputFolder* folder);

// The name that such a file has.
constexpr char kLightFieldCameraFile[] = "camera.yaml";

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_LIGHT_FIELD_CAMERA_H_
