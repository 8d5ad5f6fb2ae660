#ifndef THICKLENS_ESTIMATOR_DEPTH_NOISE_H_
#define THICKLENS_ESTIMATOR_DEPTH_NOISE_H_

#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {

// Noise that is worth the bends that smoothing takes off a surface, px of disparity per view step.
constexpr double kSmoothedNoisePx = 0.02;

struct SmoothedDepth {
  DisparityMap map;
  // Standard deviation of what the noise leaves of itself, px per view step (rms over the pixels),
  // if it is independent from pixel to pixel.
  double noise_left_px = 0;
};

// The noise of a depth, taken out along surfaces: each pixel gets the middle of the plane through
// those around it, up to 3 px away, whose disparity is its own but for five times the noise;
// weighted least squares, Gaussian weights of sigma 2 px. Planes stay what they are, a step of
// more than about seven times the noise is kept. Derived here [D94]. A pixel with less than
// six such neighbours, or all of them in a line, keeps its disparity.
// `noise_px`: standard deviation, px per view step (of the larger of the two), > 0, as DepthNoisePx
// finds it. The result does not depend on the number of threads. Throws Error if the map has holes
// or noise_px is not > 0.
SmoothedDepth SmoothDepth(const DisparityMap& map, double noise_px, int threads);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_DEPTH_NOISE_H_
