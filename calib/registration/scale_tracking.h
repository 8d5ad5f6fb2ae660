#ifndef THICKLENS_CALIB_REGISTRATION_SCALE_TRACKING_H_
#define THICKLENS_CALIB_REGISTRATION_SCALE_TRACKING_H_

#include <functional>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/image_scale.h"

namespace thicklens::calib {

// Registers the frames of a sweep to one reference, from the nearest readings outward: the law
// found so far says where the next registration starts, so that a periodic target cannot catch it a
// period off. Where that fails (a wrong reading), a ladder of scales is tried. `known_offset_mm`
// starts it off where the bench zero is given. `read_grey` gives the linear grey light of a frame
// (CV_32F) and is called from several threads; `tick` is called once a frame. Radial distortion
// that the frames show together is taken out of the scales, and what is not known of it goes into
// their errors. On a target that looks the same at every scale (ShowsShiftAlone; a knife edge is
// left to the meter of edges) the scales are taken from the readings and only shifts are measured;
// where no offset is known either, the reference is returned alone. Such samples say so.
std::vector<ScaleSample> TrackScale(const FocusSweep& sweep,
                                    const std::function<cv::Mat(std::size_t)>& read_grey,
                                    const std::vector<std::size_t>& frames, std::size_t reference,
                                    std::optional<double> known_offset_mm, int threads,
                                    const std::function<void()>& tick);

// Where the optical axis meets the region of interest, and how far its farthest corner is.
cv::Point2d RegionCentre(const FocusSweep& sweep);
double RegionCornerRadiusPx(const FocusSweep& sweep);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_SCALE_TRACKING_H_
