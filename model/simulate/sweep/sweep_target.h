#ifndef THICKLENS_MODEL_SIMULATE_SWEEP_SWEEP_TARGET_H_
#define THICKLENS_MODEL_SIMULATE_SWEEP_SWEEP_TARGET_H_

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include "model/base/random_draws.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/sweep_simulator.h"

namespace thicklens::model {

// Requirements of a sweep for its textured target. Positions are in the target's plane, mm from the
// optical axis, X right, Y down.
struct TileRequest {
  Eigen::Vector2d centre_mm{0, 0};
  double width_mm = 0;  // size of the field that the frames see, with margins
  double height_mm = 0;
  double spacing_mm = 0;  // wanted spacing of samples
  double pixel_mm = 0;    // one px on the target near the plane of focus: the unit of fine detail
  double field_mm = 0;    // the shorter side of the field there: the unit of coarse detail
};

// One period of the target. Its light has the mean 1.
struct TargetTile {
  cv::Mat samples;  // CV_64F
  double width_mm = 0;
  double height_mm = 0;
  Eigen::Vector2d origin_mm{0, 0};  // position of the sample (0, 0)
};

// Draws every kind except the edges; only kImage uses `image`. Throws Error for a feature size
// that the tile cannot show, and for an empty or black image.
TargetTile DrawTargetTile(const TargetOptions& options, const TileRequest& request,
                          const LinearImage& image, RandomDraws* draws);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SIMULATE_SWEEP_SWEEP_TARGET_H_
