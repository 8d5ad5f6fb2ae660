#ifndef THICKLENS_CAMERA_H_
#define THICKLENS_CAMERA_H_

#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"

namespace thicklens {

// A thick lens with its sensor, and what a calibration found (thicklens/model/camera.h). Lengths
// are in mm from the aperture plane Ap, sizes in px.
using Camera = model::Camera;
// A number with its standard deviation, both in the unit of the field that holds them.
using Measured = model::Estimate;

// Reads a camera file (schema thicklens/camera/2 or 1). Throws Error with file:line:column.
THICKLENS_EXPORT Camera ReadCamera(const std::string& path);
// Writes a camera file, completely or not at all. Numbers that are read back have the same bits.
// Throws Error if the camera is not valid or the file cannot be written.
THICKLENS_EXPORT void WriteCamera(const std::string& path, const Camera& camera);

// Remarks on the camera's file, one line each: former names, and assumed numbers that are neither
// published nor measured.
THICKLENS_EXPORT std::vector<std::string> NoticesOf(const Camera& camera);

}  // namespace thicklens

#endif  // THICKLENS_CAMERA_H_
