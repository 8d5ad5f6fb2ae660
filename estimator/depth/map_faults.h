#ifndef THICKLENS_ESTIMATOR_DEPTH_MAP_FAULTS_H_
#define THICKLENS_ESTIMATOR_DEPTH_MAP_FAULTS_H_

#include <opencv2/core/mat.hpp>
#include <vector>

namespace thicklens::estimator {

// Maps are CV_32F without holes. Jumps and quanta are in the unit of the map.

// The width of the edges of a map, px: the height of a step over its largest slope, the median over
// the rises along rows and columns that are alone, monotone and at least `jump` high. 1: steps.
// 0: there are fewer than twenty.
double EdgeWidthPx(const cv::Mat& map, double jump);

// The first pixels of the blocks of a map that was enlarged without interpolation, along both axes,
// with 0; empty: the map has no blocks.
struct BlockGrid {
  std::vector<int> columns, rows;
  int size_px() const;  // of the usual block; 1: there are none
};
BlockGrid FindBlocks(const cv::Mat& map);
// Interpolates linearly between the middles of the blocks.
cv::Mat WithoutBlocks(const cv::Mat& map, const BlockGrid& grid);

// The step of a quantised map: the usual difference of its values, if it has at most 1024 of them,
// most of which differ by multiples of it, and it is below half of `jump`: surfaces at larger
// distances are layers. 0: none.
double QuantumOf(const cv::Mat& map, double jump);
// Makes the values smooth within half a quantum of their own, by repeated means over the neighbours
// that differ by at most one and a half quanta. The result does not depend on the number of threads
// (0: one per core).
cv::Mat WithoutQuanta(const cv::Mat& map, double quantum, int threads);

// Replaces pixels that fewer than two of the eight neighbours resemble to `jump` by the median
// over these. Returns the share of the pixels.
double DropOutliers(double jump, cv::Mat* map);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_DEPTH_MAP_FAULTS_H_
