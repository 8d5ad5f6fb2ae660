#ifndef THICKLENS_MODEL_CAMERA_FILE_H_
#define THICKLENS_MODEL_CAMERA_FILE_H_

#include <string>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"

namespace thicklens::model {

// The camera file, schema thicklens/camera/2 (docs/file-formats.md). A file of the schema
// thicklens/camera/1 is accepted and converted. Unknown keys, wrong types and values out of range
// throw Error with file:line:column; `source_name` is the file name in these messages.
THICKLENS_EXPORT Camera ReadCamera(const std::string& path);
// Reads the text of a camera file. `source_name` is the file name in messages. Throws Error as
// ReadCamera does.
THICKLENS_EXPORT Camera ParseCamera(const std::string& text, const std::string& source_name);

// The YAML text of a camera. Numbers read back from it have the same bits. A measured PSF is named
// by MeasuredPsf::file, relative to the folder of the camera file; without a name it is left out.
THICKLENS_EXPORT std::string CameraToYaml(const Camera& camera);

// The camera without its measured PSF, for a file in a folder where the PSF's file is not.
THICKLENS_EXPORT Camera WithoutMeasuredPsf(Camera camera);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_CAMERA_FILE_H_
