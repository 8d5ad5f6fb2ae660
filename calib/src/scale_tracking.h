#ifndef THICKLENS_CALIB_SRC_SCALE_TRACKING_H_
#define THICKLENS_CALIB_SRC_SCALE_TRACKING_H_

#include <functional>
#include <optional>
#include <vector>

#include "thicklens/calib/image_scale.h"

namespace thicklens::calib {

// Registers the frames of a sweep to one reference, from the nearest readings outward: the law
// found so far says where the next registration starts, so that a periodic target cannot catch it a
// period off. `known_offset_mm` starts it off where the bench zero is given. `tick` is called once
// a frame.
std::vector<ScaleSample> TrackScale(const FocusSweep& sweep, const std::vector<std::size_t>& frames,
                                    std::size_t reference, std::optional<double> known_offset_mm,
                                    int threads, const std::function<void()>& tick);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SRC_SCALE_TRACKING_H_
