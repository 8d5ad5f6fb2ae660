#ifndef THICKLENS_CALIB_REGISTRATION_SPOT_TRACKING_H_
#define THICKLENS_CALIB_REGISTRATION_SPOT_TRACKING_H_

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calib/registration/image_scale.h"
#include "calib/registration/registration.h"
#include "calib/registration/spot_moments.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/target_finding.h"

namespace thicklens::calib {

// The points of one frame together.
struct SpotFrame {
  std::size_t frame = 0;  // index into the sweep
  // Mean of the points' sigma^2, px^2 of the frame, without the pixel box, and its error: the
  // larger of what the noise explains and the scatter of the points.
  std::optional<model::Estimate> variance_px2;
  std::optional<FreeRegistration> registration;  // to the reference
  std::string without_variance;  // why variance_px2 is absent; empty if it is present
};

// The points of a sweep.
struct SpotTracks {
  SpotFinding finding;
  std::size_t reference = 0;      // index into the sweep
  std::vector<SpotFrame> frames;  // those that show enough of the points
};

// Finds the points in the reference, and follows them through the frames in the order of the
// readings, from the reference outward. In each frame the window of all points follows their median
// sigma. The image scale is that of the similarity between the centroids, with a radial cubic term
// as lens distortion has. `read_grey` returns linear grey light, CV_32F.
SpotTracks FollowSpots(const FocusSweep& sweep,
                       const std::function<cv::Mat(std::size_t)>& read_grey,
                       const std::vector<std::size_t>& frames, std::size_t reference,
                       const std::function<void()>& tick);

// The registrations as scale samples; the reference, with scale 1, is one of them.
std::vector<ScaleSample> ScalesOfSpots(const FocusSweep& sweep, const SpotTracks& tracks);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_SPOT_TRACKING_H_
