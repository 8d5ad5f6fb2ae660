#ifndef THICKLENS_CALIB_SHARPNESS_SHARPNESS_H_
#define THICKLENS_CALIB_SHARPNESS_SHARPNESS_H_

#include <opencv2/core/mat.hpp>
#include <vector>

namespace thicklens::calib {

struct SharpnessOptions {
  double smoothing_sigma_px = 1;  // smoothing before edges and extrema are sought
  // Gradient magnitude, grey per px, above which a maximum of the gradient is an edge pixel. One
  // value serves a whole sweep: an edge set that adapts to each frame would hide the blur that is
  // to be measured.
  double edge_threshold = 0;
  int max_search_px = 64;  // range on each side in which an extremum is sought
};

struct SharpnessIndex {
  double mean_edge_slope = 0;  // grey per px; 0 if there is no edge pixel
  int edge_count = 0;
};

// MES, interpreted as "mean edge slope" [D69]: the mean over the edge pixels of |I(e+) -
// I(e-)| / distance(e+, e-), where e+ and e- are the nearest extrema on both sides along the
// gradient. The work that the paper cites (Wang, Tian, Liang & Shi 2008) was not available: this
// interpretation is inferred from the name. `grey` is CV_32F.
SharpnessIndex MeanEdgeSlope(const cv::Mat& grey, const SharpnessOptions& options);

// Returns the index for each of several thresholds, in the time that the lowest one takes.
// options.edge_threshold is not used. The index of a frame divided by its mean m, at a threshold t,
// is the index of the frame itself at t m, divided by m.
std::vector<SharpnessIndex> MeanEdgeSlopes(const cv::Mat& grey, const SharpnessOptions& options,
                                           const std::vector<double>& thresholds);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SHARPNESS_SHARPNESS_H_
