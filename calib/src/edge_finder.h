#ifndef THICKLENS_CALIB_SRC_EDGE_FINDER_H_
#define THICKLENS_CALIB_SRC_EDGE_FINDER_H_

#include <opencv2/core/mat.hpp>
#include <vector>

#include "edge_pixels.h"
#include "thicklens/calib/edge_spread.h"

namespace thicklens::calib {

// A frame, reduced by a power of two and smoothed a little against noise.
struct FrameScale {
  cv::Mat smoothed;
  Gradient gradient;
  double factor = 1;          // px of the frame per px of this one
  double gradient_noise = 0;  // sd of a component of the gradient
};
// From the frame itself down to a quarter or an eighth; fewer of a small frame.
std::vector<FrameScale> FrameScales(const cv::Mat& grey);

// Bilinear; NaN outside.
float SampleAt(const cv::Mat& grey, const Eigen::Vector2d& at);

struct FeatureCandidate {
  EdgeFeature feature;  // in px of the frame
  double strength = 0;  // contrast times the root of its length
};
// What looks like an edge with a plateau on each side, or like an X corner, in one scale.
std::vector<FeatureCandidate> EdgeCandidates(const FrameScale& scale, int most);
std::vector<FeatureCandidate> CornerCandidates(const FrameScale& scale, int most);

// A straight piece of strong gradient in a scale's px; the normal points to the bright side.
struct StraightRegion {
  Eigen::Vector2d centre{0, 0};
  double normal_rad = 0;
  double half_length = 0;
  double weight = 0;  // sum of its gradient magnitudes
};
// Pixels above the threshold that touch and agree in direction, grown from the strongest on;
// heaviest first.
std::vector<StraightRegion> StraightRegions(const Gradient& gradient, double threshold, int most);

// Brings a region's line onto the edge and finds how far along it and to its sides the edge is an
// undisturbed step; factor and noise as in the scale. Nothing if it is none.
std::optional<FeatureCandidate> UndisturbedStep(const FrameScale& scale,
                                                const StraightRegion& region);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SRC_EDGE_FINDER_H_
