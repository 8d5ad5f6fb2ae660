#ifndef THICKLENS_ESTIMATOR_DEPTH_SURFACE_PLANE_H_
#define THICKLENS_ESTIMATOR_DEPTH_SURFACE_PLANE_H_

#include <Eigen/Core>
#include <vector>

namespace thicklens::estimator {

// A disparity that is linear in image coordinates, as that of a plane is: 1/z is linear in x and y.
struct SurfacePlane {
  Eigen::Vector2d middle_px{0, 0};
  double disparity = 0;         // in the middle
  Eigen::Vector2d slope{0, 0};  // per px
  double rms = 0;               // rms of the residuals

  double At(double x, double y) const {
    return disparity + slope.dot(Eigen::Vector2d(x, y) - middle_px);
  }
};

struct SurfaceSample {
  int x = 0, y = 0;
  double disparity = 0;
};

// Fits a plane by least squares to at least one sample. In each of its two principal directions the
// slope b is multiplied by (1 - s^2/(b^2 S)), at least 0, where s^2 is the variance of the
// residuals and S the sum of squares of the positions. A slope that noise alone would give becomes
// 0, and an exact plane keeps its slope (derived here, [D95], after James and Stein). The slope is
// 0 in a direction in which the samples hardly spread, and for fewer than six samples.
SurfacePlane FitSurfacePlane(const std::vector<SurfaceSample>& samples);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_DEPTH_SURFACE_PLANE_H_
