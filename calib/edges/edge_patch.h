#ifndef THICKLENS_CALIB_EDGES_EDGE_PATCH_H_
#define THICKLENS_CALIB_EDGES_EDGE_PATCH_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "calib/edges/edge_spread.h"
#include "calib/sharpness/edge_pixels.h"

namespace thicklens::calib {

// A frame that is reduced by a power of two and smoothed slightly against noise.
struct FrameScale {
  cv::Mat smoothed;
  Gradient gradient;
  double factor = 1;          // px of the frame per px of this scale
  double gradient_noise = 0;  // standard deviation of one component of the gradient
};

struct FeatureCandidate {
  EdgeFeature feature;  // px of the frame
  double strength = 0;  // contrast times the root of the length
};

// A straight piece of strong gradient, in px of a scale. The normal points to the bright side.
struct StraightRegion {
  Eigen::Vector2d centre{0, 0};
  double normal_rad = 0;
  double half_length = 0;
  double weight = 0;  // sum of the gradient magnitudes
};

// Bilinear interpolation; NaN outside the frame.
float SampleAt(const cv::Mat& grey, const Eigen::Vector2d& at);

// Moves the line of a region onto the edge, and finds how far along the line and to its sides the
// edge is an undisturbed step. Factor and noise are those of the scale. Returns std::nullopt if
// there is no such step.
std::optional<FeatureCandidate> UndisturbedStep(const FrameScale& scale,
                                                const StraightRegion& region);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGES_EDGE_PATCH_H_
