#ifndef THICKLENS_ESTIMATOR_VIEWS_HOLE_FILLER_H_
#define THICKLENS_ESTIMATOR_VIEWS_HOLE_FILLER_H_

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "estimator/views/disparity_buffer.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {

// What the centre view can be said to show for the holes of other views: pixels that are of a
// surface with two of their neighbours (one in a picture a single pixel wide or high). Others may
// be errors of the depth, before which rays would seem to pass.
struct SupportedPixels {
  std::vector<char> is_supported;
  std::optional<float> lowest;  // of their disparities
};
// `is_surface`: of the cell below and to the right of each pixel, no jump.
SupportedPixels FindSupported(const DisparityMap& map, const std::vector<char>& is_surface);

// The samples of a view that nothing covers: what stands behind.
class HoleFiller {
 public:
  struct Sample {
    int x = 0, y = 0;
  };
  // The way from the sample to a place in the centre view, px, and the disparity there.
  struct Source {
    double way_x = 0, way_y = 0;
    float disparity = 0;
  };

  // `map` is the centre view's, `buffer` what the view shows of it, `shift` the view's way from it,
  // px per unit of disparity, not (0, 0). All but the shift must outlive it.
  HoleFiller(const DisparityMap& map, const SupportedPixels& supported,
             const DisparityBuffer& buffer, const Eigen::Vector2d& shift);

  // Row by row.
  const std::vector<Sample>& holes() const { return holes_; }

  // As RenderDisparity has it. At least one sample must be covered.
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
  const double px_per_unit_;         // of the larger part of the shift
  const Eigen::Vector2d direction_;  // of the shift, the larger part 1
  const float same_surface_;         // in the unit of the map
  // Whole steps from the sample along the direction: before these a ray is behind all of the map.
  int first_step_ = 0;
  std::vector<Sample> holes_;
  // Index of a covered sample for each hole and for those beside it; empty until it is needed.
  std::vector<int> closest_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_HOLE_FILLER_H_
