#ifndef THICKLENS_ESTIMATOR_DEPTH_SURFACE_PLANE_H_
#define THICKLENS_ESTIMATOR_DEPTH_SURFACE_PLANE_H_

#include <Eigen/Core>
#include <vector>

namespace thicklens::estimator {

// A disparity that is linear in the picture, as that of a plane is: 1/z is linear in x and y.
struct SurfacePlane {
  Eigen::Vector2d middle_px{0, 0};
  double disparity = 0;         // in the middle
  Eigen::Vector2d slope{0, 0};  // per px
  double rms = 0;               // of what it does not explain

  double At(double x, double y) const {
    return disparity + slope.dot(Eigen::Vector2d(x, y) - middle_px);
  }
};

struct SurfaceSample {
  int x = 0, y = 0;
  double disparity = 0;
};

// Least squares. In each of its two principal directions the slope b counts (1 - s^2/(b^2 S)) of
// itself, at least 0: s^2 is the variance of the residuals, S the sum of squares of the positions,
// so that what noise alone would give is no slope and an exact plane keeps its own (derived here,
// [D95], after James and Stein). A direction in which the samples hardly spread, and fewer than six
// samples, have none. There must be one sample.
SurfacePlane FitSurfacePlane(const std::vector<SurfaceSample>& samples);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_DEPTH_SURFACE_PLANE_H_
