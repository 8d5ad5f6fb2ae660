#include "thicklens/calib/frame_light.h"

#include <fmt/format.h>

#include <algorithm>

namespace thicklens::calib {

bool FrameLight::ExposureChanges() const {
  return exposure_range_stops && *exposure_range_stops > kMinExposureStops;
}

bool FrameLight::WhiteBalanceChanges() const {
  return std::max(red_change.value_or(0), blue_change.value_or(0)) > kMinWhiteBalance;
}

std::vector<std::string> FrameLight::InWords() const {
  std::vector<std::string> texts;
  if (bands) {
    texts.push_back(fmt::format(
        "whole {} brighten together by {:.2g} % (standard deviation){}, at another place in each "
        "frame: the lamp flickers under a rolling shutter; {}; expose for whole periods of the "
        "lamp, or use a steady lamp",
        bands_are_columns ? "columns" : "rows", 100 * bands->value,
        band_period_px ? fmt::format(" with a period of {:.3g} px", *band_period_px) : "",
        bands_removed ? "the bands were estimated and divided out" : "they were not removed"));
  }
  if (ExposureChanges()) {
    texts.push_back(fmt::format(
        "the light of the same part of the target changes by {:.2f} stops between the frames "
        "({:+.2f} stops over the sweep): exposure, gain or lamp changed. Each frame is compared "
        "with its own mean, so that kappa and zf do not depend on it unless values are clipped; "
        "set exposure and gain by hand",
        *exposure_range_stops, exposure_trend_stops));
  }
  if (WhiteBalanceChanges()) {
    texts.push_back(fmt::format(
        "the white balance changes between the frames: red over green by {:.2g} %, blue over green "
        "by {:.2g} %; set the white balance by hand",
        100 * red_change.value_or(0), 100 * blue_change.value_or(0)));
  }
  return texts;
}

}  // namespace thicklens::calib
