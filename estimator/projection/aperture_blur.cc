#include "thicklens/estimator/aperture_blur.h"

#include <cmath>

#include "estimator/views/ray_irradiance.h"

namespace thicklens::estimator {
namespace {

// Returns the ray of view (k, l) of the point in focus that lands at a position of the image, px
// from the principal point: landing = P s - Q u by [S16], -p x upright.
model::Ray RayLandingAt(const model::LightFieldGrid& grid, const model::Camera& camera,
                        const Eigen::Vector2d& from_axis_px, int k, int l) {
  const model::ProjectionCoefficients projection =
      model::ProjectionOf(camera.lens, camera.image_distance_mm(), grid.planes);
  const Eigen::Vector2d landing_mm = -camera.sensor.pixel_pitch_mm * from_axis_px;
  model::Ray ray = grid.RayAt(0, 0, k, l);
  ray.s_mm = (landing_mm.x() + projection.q * ray.u_mm) / projection.p;
  ray.t_mm = (landing_mm.y() + projection.q * ray.v_mm) / projection.p;
  return ray;
}

double IrradianceOf(const model::Camera& camera, const model::LightFieldGrid& grid,
                    const model::Ray& ray) {
  return model::RelativeIrradiance(camera.lens, camera.image_distance_mm(), grid.planes, ray);
}

Eigen::Vector2d SigmaAt(const model::LightFieldGrid& grid, const model::Camera& camera,
                        const Eigen::ArrayXXd& weights, const model::Camera* falloff,
                        const Eigen::Vector2d& from_axis_px) {
  double sum = 0;
  Eigen::Vector2d first(0, 0), second(0, 0);
  for (int l = 0; l < grid.v_count; ++l) {
    for (int k = 0; k < grid.u_count; ++k) {
      const model::Ray ray = RayLandingAt(grid, camera, from_axis_px, k, l);
      double weight = weights(l, k);
      if (falloff != nullptr) {
        const model::Ray on_axis = RayLandingAt(grid, camera, {0, 0}, k, l);
        weight *= IrradianceOf(*falloff, grid, ray) / IrradianceOf(*falloff, grid, on_axis);
      }
      const Eigen::Vector2d crossing_mm = model::ApertureCrossingMm(grid.planes, ray);
      sum += weight;
      first += weight * crossing_mm;
      second += weight * crossing_mm.cwiseAbs2();
    }
  }
  return (second / sum - (first / sum).cwiseAbs2()).cwiseMax(0).cwiseSqrt();
}

}  // namespace

ApertureBlur MeasureApertureBlur(const model::LightFieldGrid& grid, const model::Camera& camera,
                                 const Eigen::ArrayXXd& weights, const model::Camera* falloff) {
  CheckViewWeights(grid, weights);
  ApertureBlur blur;
  blur.calibrated_sigma_mm = camera.blur_ratio() * camera.lens.aperture_radius_mm;
  blur.sigma_mm = SigmaAt(grid, camera, weights, falloff, {0, 0});
  for (const double x_px : {0.0, grid.s_count - 1.0}) {
    for (const double y_px : {0.0, grid.t_count - 1.0}) {
      const Eigen::Vector2d there = SigmaAt(grid, camera, weights, falloff,
                                            Eigen::Vector2d(x_px, y_px) - grid.st_origin_index);
      for (const int axis : {0, 1}) {
        if (!(blur.sigma_mm[axis] > 0)) continue;
        const double change = there[axis] / blur.sigma_mm[axis] - 1;
        if (std::abs(change) > std::abs(blur.corner_change[axis]))
          blur.corner_change[axis] = change;
      }
    }
  }
  return blur;
}

}  // namespace thicklens::estimator
