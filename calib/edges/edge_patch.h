#ifndef THICKLENS_CALIB_EDGES_EDGE_PATCH_H_
#define THICKLENS_CALIB_EDGES_EDGE_PATCH_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "calib/sharpness/edge_pixels.h"
#include "thicklens/calib/edge_spread.h"

namespace thicklens::calib {

// A frame, reduced by a power of two and smoothed a little against noise.
struct FrameScale {
  cv::Mat smoothed;
  Gradient gradient;
  double factor = 1;          // px of the frame per px of this one
  double gradient_noise = 0;  // sd of a component of the gradient
};

struct FeatureCandidate {
  EdgeFeature feature;  // in px of the frame
  double strength = 0;  // contrast times the root of its length
};

// A straight piece of strong gradient in a scale's px; the normal points to the bright side.
struct StraightRegion {
  Eigen::Vector2d centre{0, 0};
  double normal_rad = 0;
  double half_length = 0;
  double weight = 0;  // sum of its gradient magnitudes
};

// Bilinear; NaN outside.
float SampleAt(const cv::Mat& grey, const Eigen::Vector2d& at);

// Brings a region's line onto the edge and finds how far along it and to its sides the edge is an
// undisturbed step; factor and noise as in the scale. Nothing if it is none.
std::optional<FeatureCandidate> UndisturbedStep(const FrameScale& scale,
                                                const StraightRegion& region);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGES_EDGE_PATCH_H_
