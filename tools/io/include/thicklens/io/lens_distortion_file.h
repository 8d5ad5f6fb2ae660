#ifndef THICKLENS_IO_LENS_DISTORTION_FILE_H_
#define THICKLENS_IO_LENS_DISTORTION_FILE_H_

#include <string>
#include <utility>

#include "thicklens/base/export.h"
#include "thicklens/model/lens_distortion.h"

namespace thicklens::io {

// A lens distortion that another program measured.
struct LensDistortionFile {
  model::LensDistortion distortion;  // in the pixels of this project: (0, 0) is a pixel's centre
  std::string format;                // for messages: "OpenCV FileStorage", "COLMAP cameras.txt"
  std::string camera;                // its name or number in a file of several; empty: there is one
  // Whether the file states the size of the photographs. If it does not, the distortion has the
  // size that the caller expected.
  bool states_size = true;
};

// Reads a lens distortion. The format is recognised by the content: OpenCV FileStorage (YAML, XML,
// JSON), ROS camera_info (YAML), Kalibr camchain (YAML), COLMAP cameras.txt and cameras.bin, mrcal
// .cameramodel, and the camera file of this project. `camera` is the name or the number of a camera
// in a file of several; empty: the file has one. `bytes` are the content of the file `name`.
// `width_px` and `height_px` are the size for files that state none; 0: they must state it. Throws
// Error that names the file and the field: it is no such file, its model is not one of OpenCV's
// (the message says what would be right), or its numbers are not valid.
THICKLENS_EXPORT LensDistortionFile ParseLensDistortion(const std::string& bytes,
                                                        const std::string& name,
                                                        const std::string& camera = "",
                                                        int width_px = 0, int height_px = 0);

// Likewise of a file: "FILE" or "FILE:CAMERA".
THICKLENS_EXPORT LensDistortionFile ReadLensDistortion(const std::string& file_and_camera,
                                                       int width_px = 0, int height_px = 0);

// Returns file and camera of "FILE" or "FILE:CAMERA"; the latter is empty if the whole text is the
// name of a file, or has no colon.
THICKLENS_EXPORT std::pair<std::string, std::string> FileAndCamera(
    const std::string& file_and_camera);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_LENS_DISTORTION_FILE_H_
