#ifndef THICKLENS_CALIB_EDGES_LONE_EDGE_H_
#define THICKLENS_CALIB_EDGES_LONE_EDGE_H_

#include <opencv2/core/mat.hpp>

namespace thicklens::calib {

// Whether a sharp frame (linear light, CV_32F) shows one straight edge and nothing else: the pixels
// with at least a quarter of the steepest gradient lie within a few px of one line, along at least
// half of the shorter side.
bool ShowsLoneEdge(const cv::Mat& grey);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_EDGES_LONE_EDGE_H_
