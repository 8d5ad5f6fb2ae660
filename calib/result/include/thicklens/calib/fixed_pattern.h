#ifndef THICKLENS_CALIB_FIXED_PATTERN_H_
#define THICKLENS_CALIB_FIXED_PATTERN_H_

#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// Structure that stays at the same pixels in every frame while the target changes its size and its
// blur: shading of the lens or of a lamp that moves with the camera, dust, defective pixels, and
// columns or rows of unequal gain. What was found beyond doubt is removed from the light of the
// frames before their scale, sharpness and blur are measured. Unevenness of the target's own light
// moves with the target and is not part of it.
struct FixedPattern {
  bool measured = false;            // true if the frames were examined
  std::string message = "not run";  // how it ended; if nothing was examined, the reason

  // Light at the corners of the region over that at its centre, in stops (factors of 2): the mean
  // of the four corners, negative where they are darker. Absent: the target's scale changes too
  // little to distinguish the shading of the frame from that of the target.
  std::optional<model::Estimate> corner_stops;
  bool shading_removed = false;  // true: the frames were divided by the shading

  int specks = 0;               // places larger than a few pixels: dust, drops, scratches
  double deepest_speck = 0;     // largest relative change of the light by a speck, 0 to 1
  int defective_px = 0;         // single pixels, or groups of up to four, that differ: hot, dead
  double divided_share = 0;     // share of the region that was divided by what specks let through
  double filled_share = 0;      // share of the region that was filled from the pixels around it
  double column_deviation = 0;  // relative standard deviation of fixed columns; 0: none was found
  double row_deviation = 0;     // the same for rows

  // Whether anything was removed from the frames.
  THICKLENS_EXPORT bool Removed() const;
  // Text of one sentence that describes what was removed; empty if nothing was.
  THICKLENS_EXPORT std::string InWords() const;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIXED_PATTERN_H_
