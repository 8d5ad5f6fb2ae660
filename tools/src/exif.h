#ifndef THICKLENS_TOOLS_EXIF_H_
#define THICKLENS_TOOLS_EXIF_H_

#include <optional>
#include <string>

namespace thicklens::tools {

// What a photograph says of the camera that took it. Absent: not said, or not usable.
struct PhotoExif {
  std::optional<double> focal_length_mm;
  std::optional<double> f_number;
  std::optional<double> pixel_pitch_mm;
  std::string why_no_pitch;  // where pixel_pitch_mm is absent
  std::string model;
};

// Throws Error if the file cannot be read as a picture with metadata. A photograph without EXIF
// gives nothing. `width_px` and `height_px` are those of the pictures the camera file is for.
PhotoExif ReadPhotoExif(const std::string& path, int width_px, int height_px);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_EXIF_H_
