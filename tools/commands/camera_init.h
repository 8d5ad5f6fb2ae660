#ifndef THICKLENS_TOOLS_COMMANDS_CAMERA_INIT_H_
#define THICKLENS_TOOLS_COMMANDS_CAMERA_INIT_H_

#include <optional>
#include <string>

#include "thicklens/io/exif.h"
#include "thicklens/io/image_file.h"
#include "thicklens/model/camera.h"

namespace thicklens::tools {

// A camera as the user describes it; absent: not given.
struct CameraDescription {
  std::optional<double> front_focal_length_mm;
  std::optional<double> rear_focal_length_mm;
  std::optional<double> lens_thickness_mm;
  std::optional<double> f_number;
  std::optional<double> pixel_pitch_um;
  std::optional<Eigen::Vector2i> size_px;
  std::optional<Eigen::Vector2d> principal_point_px;
  std::optional<std::string> transfer;  // absent: srgb, marked as assumed
  std::string psf = "gaussian";
  std::string name;
};

// Makes the camera file's content. Given values are used as they are; values from `photo` (of the
// size `photo_size_px`) or by default are marked as assumed. Throws Error that lists what is
// missing and how to give it.
// `facts` is what the photograph's file states, null without one: a raw file has linear values,
// which is not an assumption.
model::Camera DescribedCamera(const CameraDescription& description,
                              const std::optional<io::PhotoExif>& photo,
                              const std::optional<Eigen::Vector2i>& photo_size_px,
                              const io::ImageFacts* facts = nullptr);

// Where two values of the camera come from, in words.
struct SensorSources {
  std::string size;         // of width_px and height_px
  std::string pixel_pitch;  // of pixel_pitch_mm
};
// The arguments are those that DescribedCamera made a camera of.
SensorSources SourcesOf(const CameraDescription& description,
                        const std::optional<io::PhotoExif>& photo, const io::ImageFacts* facts);
// The lines of comment that state the sources in a camera file.
std::string SourcesComment(const SensorSources& sources);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_COMMANDS_CAMERA_INIT_H_
