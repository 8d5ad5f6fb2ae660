#ifndef THICKLENS_ESTIMATOR_DEPTH_EDGE_LABELS_H_
#define THICKLENS_ESTIMATOR_DEPTH_EDGE_LABELS_H_

#include <opencv2/core/mat.hpp>

namespace thicklens::estimator {

// How the pixels beside a depth edge are given to its two surfaces. Lengths are px.
struct EdgeLabelOptions {
  double jump = 0.25;   // smallest jump between neighbours that is an edge, in the unit of the map
  double reach_px = 4;  // distance from an edge within which a pixel may change its side
  double edge_sigma_px = 1;    // standard error of the position of the map's edges
  double colour_sigma = 0.02;  // difference of the guide that is none
  double colour_weight = 1;    // of the colours against the position
  double smoothness = 1.5;     // cost of an edge of the map, per px, where the guide has none
  double unsure_px = 0;       // distance from an edge within which the side of a sample is not used
  int least_dilation_px = 2;  // AlignEdges tries no smaller change of the width
  int threads = 0;            // 0: one per core
};

// Replaces the ramps of a map whose edges are `width_px` wide by steps: a pixel of a ramp gets the
// larger or the smaller disparity of its surroundings, whichever is nearer to its own. A ramp is
// where the range of the surroundings is several times that of the flanks [D191]; slopes are none.
// `map` is CV_32F without holes.
void SharpenEdges(double width_px, double jump, cv::Mat* map);

// Decides anew for each pixel near a depth edge to which of the two surfaces of the edge it
// belongs. The colours of the surroundings on each side say how likely the pixel is of that side,
// the distance to the map's own edge how likely it is to have changed, and an edge of the map is
// cheap where the guide has one. The sum is least for a minimum cut [D192]. A pixel that changes
// its side gets the disparity of the other side at the edge. `guide`: CV_32FC1 or CV_32FC3; `map`
// as above. Returns the share of the pixels that changed.
void LabelEdges(const cv::Mat& guide, const EdgeLabelOptions& options, cv::Mat* map);
// Likewise for the pixels of `unknown` (CV_8U) alone, which the map does not place on a side: a
// hole that was filled.
void LabelUnknown(const cv::Mat& guide, const cv::Mat& unknown, const EdgeLabelOptions& options,
                  cv::Mat* map);

// Where the photograph has the edges of a map, px.
struct EdgeAlignment {
  // Distances by which the map lies to the right of and below the photograph, and by which its near
  // surfaces are too wide on each side.
  double right_px = 0, down_px = 0, dilation_px = 0;
  // The gain in the mean agreement of a pixel over the map as it is, and its standard error.
  double gain = 0, gain_sigma = 0;
  double agreement = 0;  // of the map as it is: mean preference of a pixel for its own side
};

// Compares the map with the colours on both sides of its edges. The sum over the pixels near the
// edges of the preference for the side that the map states is largest where the map is right
// [D193]: the map is moved by whole px, and its near surfaces are made narrower or wider. The error
// is from the scatter among parts of the image. `map` and `guide` as above.
EdgeAlignment AlignEdges(const cv::Mat& guide, const cv::Mat& map, const EdgeLabelOptions& options);

// Returns the map without that displacement and width.
cv::Mat Aligned(const cv::Mat& map, const EdgeAlignment& alignment);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_DEPTH_EDGE_LABELS_H_
