#ifndef THICKLENS_CALIB_FRAME_LIGHT_H_
#define THICKLENS_CALIB_FRAME_LIGHT_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// Changes of the light from one frame to the next. A lamp that flickers under a
// rolling shutter makes bands, an automatic exposure changes the light of a whole frame, and an
// automatic white balance changes that of a colour.
struct FrameLight {
  // Limits above which a change of the exposure (stops) or of the white balance (relative) is
  // reported.
  static constexpr double kMinExposureStops = 0.25, kMinWhiteBalance = 0.02;

  // Bands: relative standard deviation of the light between rows, in a pattern that is another one
  // in each frame. It is the median over the frames with the standard deviation of a frame's value.
  // Absent: no bands were found.
  std::optional<model::Estimate> bands;
  bool bands_are_columns = false;  // true: `bands` is between columns
  bool bands_removed = false;      // true: the bands were estimated and divided out
  // Period of the bands, px, where most of the frames show the same one.
  std::optional<double> band_period_px;

  // Light of the same part of the target in the brightest frame over that in the darkest, stops.
  // Absent: too few frames were registered.
  std::optional<double> exposure_range_stops;
  // Change of this light from the first to the last reading by its trend, stops; present with
  // exposure_range_stops. A lamp that moves with the camera or with the target has a part of it.
  double exposure_trend_stops = 0;
  // Largest over smallest ratio of red to green and of blue to green over the frames, minus 1.
  // Absent: the frames are grey.
  std::optional<double> red_change;
  std::optional<double> blue_change;  // see red_change

  // Whether the exposure changed by enough to be reported.
  THICKLENS_EXPORT bool ExposureChanges() const;
  // Whether the white balance changed by enough to be reported.
  THICKLENS_EXPORT bool WhiteBalanceChanges() const;
  // Text of one sentence for each finding, with its remedy; empty if there is none.
  THICKLENS_EXPORT std::vector<std::string> InWords() const;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FRAME_LIGHT_H_
