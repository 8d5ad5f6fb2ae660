#ifndef THICKLENS_IO_EXIF_H_
#define THICKLENS_IO_EXIF_H_

#include <optional>
#include <string>

#include "thicklens/base/export.h"

namespace thicklens::io {

struct RawFacts;

// A photograph's statements about the camera that took it. Absent: not stated, or not usable.
struct PhotoExif {
  std::optional<double> focal_length_mm;  // focal length of the lens, mm
  std::optional<double> f_number;         // focal length over the diameter of the aperture
  std::optional<double> pixel_pitch_mm;   // of the image's pixels, mm
  std::string why_no_pitch;               // set if pixel_pitch_mm is absent
  std::string pitch_source;               // the field that pixel_pitch_mm is from, in words
  std::string model;                      // name of the camera; empty: not stated
  // Distance that the lens was focused at; infinite if EXIF says so.
  std::optional<double> subject_distance_mm;
  std::optional<double> focal_length_35mm;  // equivalent of a frame of 36 x 24 mm
  std::optional<double> digital_zoom;       // ratio; 1: none
  // The image as the camera made it, before it was scaled or cropped; not stated about the pixels
  // of a raw file.
  std::optional<int> made_width_px, made_height_px;
  std::optional<double> made_pixel_pitch_mm;  // of the pixels of that image
  int orientation = 1;                        // 1 to 8; 1: as stored

  // Returns whether EXIF states nothing that can be compared with a camera file.
  THICKLENS_EXPORT bool IsEmpty() const;
};

// Throws Error if the file cannot be read as an image with metadata. A photograph without EXIF
// gives an empty result. `width_px` and `height_px` are those of the images that the camera file is
// for.
// `raw` is what a raw file states about its sensor, null for others. The pixels of a raw file are
// the sensor's, whatever size the camera gives to its own JPEG, so that the pitch is taken if the
// stated size is that of the sensor within its margins. It is not taken if the file's pixels, or
// those that EXIF counts, may be others: sRAW, linear DNG, halves, binning.
THICKLENS_EXPORT PhotoExif ReadPhotoExif(const std::string& path, int width_px, int height_px,
                                         const RawFacts* raw = nullptr);
// Reads a file that need not be able to hold EXIF. The result is empty if it cannot, and if its
// metadata is damaged; `why` then gets the reason.
THICKLENS_EXPORT PhotoExif ReadExifIfAny(const std::string& path, int width_px, int height_px,
                                         std::string* why, const RawFacts* raw = nullptr);

}  // namespace thicklens::io

#endif  // THICKLENS_IO_EXIF_H_
