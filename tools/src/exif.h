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
  // Where the lens was focused; infinite where EXIF says so.
  std::optional<double> subject_distance_mm;
  std::optional<double> focal_length_35mm;  // equivalent of a frame of 36 x 24 mm
  std::optional<double> digital_zoom;       // ratio; 1: none
  // The picture as the camera made it, before it was scaled or cut.
  std::optional<int> made_width_px, made_height_px;
  std::optional<double> made_pixel_pitch_mm;
  int orientation = 1;  // 1 to 8; 1: as stored

  // Whether EXIF says anything that a camera file says, too.
  bool IsEmpty() const;
};

// Throws Error if the file cannot be read as a picture with metadata. A photograph without EXIF
// gives nothing. `width_px` and `height_px` are those of the pictures the camera file is for.
PhotoExif ReadPhotoExif(const std::string& path, int width_px, int height_px);
// The same of a file that need not be of a kind that can hold EXIF: empty then, and where its
// metadata is damaged, for which `why` gets the reason.
PhotoExif ReadExifIfAny(const std::string& path, int width_px, int height_px, std::string* why);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_EXIF_H_
