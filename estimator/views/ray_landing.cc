#include "estimator/views/ray_landing.h"

#include <cmath>
#include <cstddef>

namespace thicklens::estimator {
namespace {

// A ray lands on its sample if its distance to it, over all views, is less than this.
constexpr double kRoundingPx = 1e-9;

// The nearest pixel is floor(. + 1/2), as in g.
void SetLanding(double step_px, int count, std::vector<int>* shift, std::vector<double>* fraction) {
  for (int k = 0; k < count; ++k) {
    const double landing_px = step_px * (k - (count - 1) / 2.0);
    const double nearest_px = std::floor(landing_px + 0.5);
    const double rest_px = landing_px - nearest_px;
    shift->push_back(static_cast<int>(nearest_px));
    fraction->push_back(std::abs(rest_px) < kRoundingPx ? 0.0 : rest_px);
  }
}

}  // namespace

// x = cx - i_x/p with i_x = P s - Q u [S16]: the part of u is Q u/p.
Eigen::Vector2d LandingStepPx(const model::Camera& camera, const model::LightFieldGrid& grid) {
  const double q = model::ProjectionOf(camera.lens, camera.image_distance_mm(), grid.planes).q;
  const double per_mm = q / camera.sensor.pixel_pitch_mm;
  Eigen::Vector2d step_px(per_mm * grid.u_step_mm, per_mm * grid.v_step_mm);
  if (std::abs(step_px.x()) * grid.u_count < kRoundingPx) step_px.x() = 0;
  if (std::abs(step_px.y()) * grid.v_count < kRoundingPx) step_px.y() = 0;
  return step_px;
}

kernels::BlockGeometry BlockOf(const model::LightField& light_field, const model::PixelRect& rect,
                               const Eigen::ArrayXXd& weights) {
  kernels::BlockGeometry block;
  block.first_x = rect.x;
  block.first_y = rect.y;
  block.width_px = rect.width;
  block.height_px = rect.height;
  block.s_count = light_field.s_count;
  block.t_count = light_field.t_count;
  block.u_count = light_field.u_count;
  block.v_count = light_field.v_count;
  SetLanding(light_field.landing_step_px.x(), block.u_count, &block.s_shift, &block.s_fraction);
  SetLanding(light_field.landing_step_px.y(), block.v_count, &block.t_shift, &block.t_fraction);
  for (int l = 0; l < block.v_count; ++l) {
    for (int k = 0; k < block.u_count; ++k) block.view_weight.push_back(weights(l, k));
  }
  return block;
}

}  // namespace thicklens::estimator
