#ifndef THICKLENS_CALIB_SHARPNESS_H_
#define THICKLENS_CALIB_SHARPNESS_H_

#include <opencv2/core/mat.hpp>
#include <vector>

namespace thicklens::calib {

struct SharpnessOptions {
  double smoothing_sigma_px = 1;  // of the frame in which edges and extrema are looked for
  // Gradient magnitude, grey per px, above which a gradient maximum is an edge pixel. One value for
  // a whole sweep: an edge set that adapts to each frame would hide the blur it is to measure.
  double edge_threshold = 0;
  int max_search_px = 64;  // how far an extremum is looked for on each side
};

struct SharpnessIndex {
  double mean_edge_slope = 0;  // grey per px; 0 if there is no edge pixel
  int edge_count = 0;
};

// MES, read as "mean edge slope" [D69]: over the edge pixels, |I(e+) - I(e-)| / distance(e+, e-)
// with e+ and e- the nearest extrema on both sides along the gradient, averaged. The paper that the
// source cites (Wang, Tian, Liang & Shi 2008) could not be had: this reading is inferred from the
// name. `grey` is CV_32F.
SharpnessIndex MeanEdgeSlope(const cv::Mat& grey, const SharpnessOptions& options);

// The same for several thresholds at once, in the time that the lowest takes;
// options.edge_threshold is not looked at. The index of a frame divided by its mean m at a
// threshold t is the frame's own at t m, divided by m.
std::vector<SharpnessIndex> MeanEdgeSlopes(const cv::Mat& grey, const SharpnessOptions& options,
                                           const std::vector<double>& thresholds);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SHARPNESS_H_
