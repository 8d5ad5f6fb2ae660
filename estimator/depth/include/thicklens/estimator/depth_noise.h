#ifndef THICKLENS_ESTIMATOR_DEPTH_NOISE_H_
#define THICKLENS_ESTIMATOR_DEPTH_NOISE_H_

#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/disparity_map.h"

namespace thicklens::estimator {

// Noise of a depth that justifies the loss of curvature by smoothing, px of disparity per view
// step.
constexpr double kSmoothedNoisePx = 0.02;

// A map whose noise was reduced.
struct SmoothedDepth {
  DisparityMap map;  // the smoothed map
  // Standard deviation of the noise that remains, px per view step (rms over the pixels), for noise
  // that is independent from pixel to pixel.
  double noise_left_px = 0;
};

// Removes the noise of a depth along surfaces. Each pixel gets the central value of the plane
// through the pixels around it, up to 3 px away, whose disparity differs from its own by at most
// five times the noise. The plane is fitted by weighted least squares with Gaussian weights of
// sigma 2 px. Planes remain unchanged, and a step of more than about seven times the noise is kept.
// A pixel with fewer than six such neighbours, or with all of them in a line, keeps its disparity.
// Derived here [D94]. `noise_px`: standard deviation, px per view step (of the larger of the two
// steps), > 0, as DepthNoisePx finds it. The result does not depend on the number of threads.
// `confidence`, 0 to 1 per pixel, multiplies the weights of the neighbours, and a pixel that has
// less than those around it yields to them; empty: all are equal. Throws Error if the map has
// holes, noise_px is not > 0 or the number of confidences does not fit.
THICKLENS_EXPORT SmoothedDepth SmoothDepth(const DisparityMap& map, double noise_px, int threads,
                                           const std::vector<float>& confidence = {});

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_DEPTH_NOISE_H_
