#ifndef THICKLENS_CALIB_EDGES_EDGE_FINDER_H_
#define THICKLENS_CALIB_EDGES_EDGE_FINDER_H_

#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/edges/edge_patch.h"
#include "calib/sharpness/edge_pixels.h"

namespace thicklens::calib {

// From the frame itself down to a quarter or an eighth; fewer of a small frame.
std::vector<FrameScale> FrameScales(const cv::Mat& grey);

// What looks like an edge with a plateau on each side, or like an X corner, in one scale.
std::vector<FeatureCandidate> EdgeCandidates(const FrameScale& scale, int most);
std::vector<FeatureCandidate> CornerCandidates(const FrameScale& scale, int most);

// Pixels above the threshold that touch and agree in direction, grown from the strongest on;
// heaviest first.
std::vector<StraightRegion> StraightRegions(const Gradient& gradient, double threshold, int most);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGES_EDGE_FINDER_H_
