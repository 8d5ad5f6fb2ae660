#ifndef THICKLENS_ESTIMATOR_SRC_HOLE_FILLER_H_
#define THICKLENS_ESTIMATOR_SRC_HOLE_FILLER_H_

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include "disparity_buffer.h"

namespace thicklens::estimator {

// The samples that nothing covers: each takes over a covered one.
class HoleFiller {
 public:
  struct Sample {
    int x = 0, y = 0;
  };

  // `direction`: of the displacement between views, not (0, 0).
  HoleFiller(const DisparityBuffer& buffer, const Eigen::Vector2d& direction);

  // Row by row.
  const std::vector<Sample>& holes() const { return holes_; }

  // The farther of the first covered samples on both sides along the direction; of two equally far
  // ones the closer. Where there is none, the covered sample closest by steps along rows and
  // columns. At least one sample must be covered.
  Sample Background(int x, int y);

 private:
  struct Found {
    Sample sample;
    int steps = 0;
  };

  std::optional<Found> Walk(int x, int y, int sense) const;
  Sample Closest(int x, int y);
  void SpreadCovered();

  const DisparityBuffer& buffer_;
  const Eigen::Vector2d direction_;
  std::vector<Sample> holes_;
  // Index of a covered sample for each hole and for those beside it; empty until it is needed.
  std::vector<int> closest_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SRC_HOLE_FILLER_H_
