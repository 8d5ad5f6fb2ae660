#ifndef THICKLENS_CALIB_GRID_GRID_DETECTION_H_
#define THICKLENS_CALIB_GRID_GRID_DETECTION_H_

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "calib/grid/grid_adjustment.h"
#include "thicklens/model/target_grid.h"

namespace thicklens::calib {

// Finds the grid in linear light (CV_32F), by OpenCV. The points of a chequerboard are the saddles
// between its squares, which blur does not displace; those of circles are the centroids. A grid
// that looks the same upside down is read with its first row most upright. Absent: the frame does
// not show it, or is too blurred.
std::optional<GridView> DetectGrid(const cv::Mat& light, const model::TargetGrid& grid);

// A marker in an image: its number and its corners, clockwise from the top left, px.
struct FoundMarker {
  int number = 0;
  std::vector<Eigen::Vector2d> corners_px;
  Eigen::Vector2d CentrePx() const;
};
// Finds the markers of a dictionary. Empty also where the program was built without aruco.
std::vector<FoundMarker> FindMarkers(const cv::Mat& light, const std::string& dictionary);

// Whether markers can be found at all.
bool CanFindMarkers();

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_GRID_GRID_DETECTION_H_
