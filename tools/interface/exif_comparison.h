#ifndef THICKLENS_TOOLS_INTERFACE_EXIF_COMPARISON_H_
#define THICKLENS_TOOLS_INTERFACE_EXIF_COMPARISON_H_

#include <vector>

#include "thicklens/camera.h"
#include "thicklens/estimate.h"
#include "thicklens/io/exif.h"

namespace thicklens {

// Facts about the photograph besides its EXIF.
struct PhotoSize {
  int width_px = 0, height_px = 0;  // as stored
  bool is_part_of_sensor = false;   // EstimateOptions::sensor_origin states which part
};

// Compares both statements. Rules (docs/light-fields.md):
// - Focal length against front_focal_length_mm .. rear_focal_length_mm: half a unit of the last
//   digit of EXIF, and the camera file's tolerance. Without a stated tolerance EXIF's nominal value
//   may be 5 % off, which is undecided.
// - F-number against f1/(2 r): the same rounding and tolerances; up to 6 % beyond, half of a third
//   of a stop, is undecided.
// - Focus distance against zf (from the aperture) .. zf + d1 (from the sensor): 10 % and the
//   rounding; beyond a factor of 1.5 it contradicts.
// - 35 mm equivalent against the size of the sensor; pixel pitch; size of the image as made;
//   digital zoom; orientation.
std::vector<ExifComparison> CompareExif(const io::PhotoExif& exif, const Camera& camera,
                                        const PhotoSize& size);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_EXIF_COMPARISON_H_
