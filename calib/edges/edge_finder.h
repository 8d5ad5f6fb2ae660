#ifndef THICKLENS_CALIB_EDGES_EDGE_FINDER_H_
#define THICKLENS_CALIB_EDGES_EDGE_FINDER_H_

#include <opencv2/core/mat.hpp>
#include <vector>

#include "calib/edges/edge_patch.h"
#include "calib/sharpness/edge_pixels.h"

namespace thicklens::calib {

// The scales of a frame, from full resolution down to a quarter or an eighth. A small frame has
// fewer scales.
std::vector<FrameScale> FrameScales(const cv::Mat& grey);

// The structures in one scale that look like an edge with a plateau on each side, or like an X
// corner; at most `most` of them.
std::vector<FeatureCandidate> EdgeCandidates(const FrameScale& scale, int most);
std::vector<FeatureCandidate> CornerCandidates(const FrameScale& scale, int most);

// Connected pixels above the threshold that agree in direction. The regions grow from the strongest
// pixels on, and are sorted by weight, the heaviest first.
std::vector<StraightRegion> StraightRegions(const Gradient& gradient, double threshold, int most);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGES_EDGE_FINDER_H_
