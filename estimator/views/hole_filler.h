#ifndef THICKLENS_ESTIMATOR_VIEWS_HOLE_FILLER_H_
#define THICKLENS_ESTIMATOR_VIEWS_HOLE_FILLER_H_

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "estimator/views/disparity_buffer.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {

// The pixels of the centre view that may occlude the holes of other views: pixels that share a
// surface with two of their neighbours (with one in an image a single pixel wide or high). Other
// pixels may be errors of the depth, in front of which rays would seem to pass.
struct SupportedPixels {
  std::vector<char> is_supported;
  std::optional<float> lowest;  // minimum disparity of the supported pixels
};
// `is_surface`: whether the cell below and to the right of each pixel has no jump.
SupportedPixels FindSupported(const DisparityMap& map, const std::vector<char>& is_surface);

// Finds the background of the samples of a view that nothing covers.
class HoleFiller {
 public:
  struct Sample {
    int x = 0, y = 0;
  };
  // Displacement from the sample to a place in the centre view, px, and the disparity there.
  struct Source {
    double way_x = 0, way_y = 0;
    float disparity = 0;
  };

  // `map` is of the centre view, `buffer` holds the surfaces visible in the other view, and `shift`
  // is the displacement to the centre view in px per unit of disparity, not (0, 0). All arguments
  // except the shift must outlive the object.
  HoleFiller(const DisparityMap& map, const SupportedPixels& supported,
             const DisparityBuffer& buffer, const Eigen::Vector2d& shift);

  // Uncovered samples, row by row.
  const std::vector<Sample>& holes() const { return holes_; }

  // Returns the background source of the sample, as RenderDisparity specifies it. At least one
  // sample must be covered.
  Source Background(int x, int y);

 private:
  struct Found {
    Sample sample;
    int steps = 0;
  };

  Sample At(int x, int y, int steps) const;
  std::optional<Found> Walk(int x, int y, int sense) const;
  std::optional<Sample> LastBefore(int x, int y) const;
  Source SourceAt(const Sample& hole, const Sample& covered) const;
  Sample Closest(int x, int y);
  void SpreadCovered();

  const DisparityMap& map_;
  const SupportedPixels& supported_;
  const DisparityBuffer& buffer_;
  const Eigen::Vector2d shift_;
  const double px_per_unit_;         // larger component of the shift
  const Eigen::Vector2d direction_;  // direction of the shift; its larger component is 1
  const float same_surface_;         // in the unit of the map
  // Whole steps from the sample along the direction; at fewer steps a ray is behind the whole map.
  int first_step_ = 0;
  std::vector<Sample> holes_;
  // Index of a covered sample for each hole and for the samples beside holes; empty until needed.
  std::vector<int> closest_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_HOLE_FILLER_H_
