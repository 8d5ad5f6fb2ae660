#ifndef THICKLENS_ESTIMATOR_FIND_PART_H_
#define THICKLENS_ESTIMATOR_FIND_PART_H_

#include <Eigen/Core>

#include "thicklens/base/export.h"
#include "thicklens/estimator/resample_depth.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// The part of a photograph whose edges fit those of a depth map best.
struct FoundPart {
  Eigen::Vector2d corner_px{0, 0}, size_px{0, 0};  // of the rectangle, px of the photograph
  double correlation = 0;                          // of the edges, up to 1
  // Number of standard errors by which it fits better than every other part: one whose middle
  // or whose size differs by more than three samples of the map.
  double sigma = 0;
};

// Looks for the part of the photograph that the map shows [D190]: a rectangle of the map's aspect
// ratio inside the photograph, at least half as wide or as high as it, not turned. The measure is
// the correlation of the magnitudes of both gradients; its error is that of as many independent
// samples as the smoothing leaves. `sigma` is 0 if the map or the photograph has no edges. Throws
// Error if the sizes do not fit.
THICKLENS_EXPORT FoundPart FindPart(const DepthSampling& map, const model::LinearImage& photo);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_FIND_PART_H_
