#ifndef THICKLENS_MODEL_OPTICS_RAY_IRRADIANCE_H_
#define THICKLENS_MODEL_OPTICS_RAY_IRRADIANCE_H_

#include <Eigen/Core>
#include <cmath>

namespace thicklens::model {

// Relative irradiance cos(alpha) cos^3(beta) of [S12], dimensionless. alpha is the angle to the
// axis in front of the lens; `slope` is the ray's slope there, mm to the right and down per mm of
// depth. beta is the angle behind the lens, where the ray runs from `aperture_mm` to -landing_mm
// over the distance d1. Erratum of [S9], kept: for rho != 0 the ray would have to start at the rear
// principal plane.
inline double RayIrradiance(const Eigen::Vector2d& slope, const Eigen::Vector2d& landing_mm,
                            const Eigen::Vector2d& aperture_mm, double image_distance_mm) {
  const double tan2_alpha = slope.squaredNorm();
  const double tan2_beta =
      (landing_mm + aperture_mm).squaredNorm() / (image_distance_mm * image_distance_mm);
  return 1 / (std::sqrt((1 + tan2_alpha) * (1 + tan2_beta)) * (1 + tan2_beta));
}

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_OPTICS_RAY_IRRADIANCE_H_
