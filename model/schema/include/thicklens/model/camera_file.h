#ifndef THICKLENS_MODEL_CAMERA_FILE_H_
#define THICKLENS_MODEL_CAMERA_FILE_H_

#include <string>

#include "thicklens/model/camera.h"

namespace thicklens::model {

// The camera file, schema thicklens/camera/2 (docs/file-formats.md). Unknown keys, wrong types,
// values out of range: Error with file:line:column.
Camera ReadCamera(const std::string& path);
Camera ParseCamera(const std::string& text, const std::string& source_name);

// Numbers are written so that reading them back gives the same bits.
std::string CameraToYaml(const Camera& camera);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_CAMERA_FILE_H_
