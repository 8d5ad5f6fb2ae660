#include "ray_irradiance.h"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>

#include "ray_landing.h"
#include "thicklens/error.h"
#include "thicklens/model/parallel.h"

namespace thicklens::estimator {
namespace {

void CheckWeights(const model::LightFieldGrid& grid, const Eigen::ArrayXXd& weights) {
  if (weights.cols() != grid.u_count || weights.rows() != grid.v_count) {
    throw Error(fmt::format("weights are {}x{} for {}x{} views: the counts must be equal",
                            weights.cols(), weights.rows(), grid.u_count, grid.v_count));
  }
  if (!(weights >= 0).all() || !(weights.sum() > 0)) {
    throw Error(
        fmt::format("weights of the views: their sum is {}: they must be >= 0, one of them "
                    "> 0",
                    weights.sum()));
  }
}

double IrradianceOf(const model::Camera& camera, const model::LightFieldGrid& grid,
                    const model::Ray& ray) {
  return model::RelativeIrradiance(camera.lens, camera.image_distance_mm(), grid.planes, ray);
}

// The weighted mean over the rays that land at the principal point: P s = Q u by (16), so
// s = Q u/P; s = 0 with ST in the plane of focus.
double IrradianceAtPrincipalPoint(const model::LightFieldGrid& grid, const model::Camera& camera,
                                  const Eigen::ArrayXXd& weights) {
  const model::ProjectionCoefficients projection =
      model::ProjectionOf(camera.lens, camera.image_distance_mm(), grid.planes);
  const double s_per_u = projection.q / projection.p;
  double sum = 0;
  for (int l = 0; l < grid.v_count; ++l) {
    for (int k = 0; k < grid.u_count; ++k) {
      model::Ray ray = grid.RayAt(0, 0, k, l);
      ray.s_mm = s_per_u * ray.u_mm;
      ray.t_mm = s_per_u * ray.v_mm;
      sum += weights(l, k) * IrradianceOf(camera, grid, ray);
    }
  }
  return sum / weights.sum();
}

// Samples from a pixel to the ray of view k that lands nearest to it.
int NearestRayShift(double landing_step_px, int k, int count) {
  return -static_cast<int>(std::floor(landing_step_px * (k - (count - 1) / 2.0) + 0.5));
}

// Weighted sums over the views at one pixel.
struct PixelSum {
  double irradiance = 0, weight = 0;

  void Add(double ray_irradiance, double ray_weight) {
    irradiance += ray_weight * ray_irradiance;
    weight += ray_weight;
  }
};

// The mean over the rays of all views that land nearest to the pixel (x, y).
double MeanIrradianceAt(const model::LightFieldGrid& grid, const model::Camera& camera,
                        const Eigen::ArrayXXd& weights, const Eigen::Vector2d& landing_step_px,
                        int x, int y) {
  PixelSum sampled;
  PixelSum all;
  for (int l = 0; l < grid.v_count; ++l) {
    const int j = y + NearestRayShift(landing_step_px.y(), l, grid.v_count);
    for (int k = 0; k < grid.u_count; ++k) {
      if (weights(l, k) == 0) continue;
      const int i = x + NearestRayShift(landing_step_px.x(), k, grid.u_count);
      const double irradiance = IrradianceOf(camera, grid, grid.RayAt(i, j, k, l));
      all.Add(irradiance, weights(l, k));
      const bool exists = i >= 0 && i < grid.s_count && j >= 0 && j < grid.t_count;
      if (exists) sampled.Add(irradiance, weights(l, k));
    }
  }
  const PixelSum& sum = sampled.weight > 0 ? sampled : all;
  return sum.irradiance / sum.weight;
}

}  // namespace

std::vector<float> RelativeFalloff(const model::LightFieldGrid& grid, const model::Camera& camera,
                                   const Eigen::ArrayXXd& weights, int k, int l) {
  CheckWeights(grid, weights);
  const double unit = IrradianceAtPrincipalPoint(grid, camera, weights);
  std::vector<float> falloff;
  falloff.reserve(static_cast<std::size_t>(grid.s_count) * static_cast<std::size_t>(grid.t_count));
  for (int j = 0; j < grid.t_count; ++j) {
    for (int i = 0; i < grid.s_count; ++i) {
      falloff.push_back(
          static_cast<float>(IrradianceOf(camera, grid, grid.RayAt(i, j, k, l)) / unit));
    }
  }
  return falloff;
}

std::vector<float> FalloffOfPicture(const model::LightFieldGrid& grid, const model::Camera& camera,
                                    const Eigen::ArrayXXd& weights, int width_px, int height_px,
                                    int threads) {
  CheckWeights(grid, weights);
  const double unit = IrradianceAtPrincipalPoint(grid, camera, weights);
  const Eigen::Vector2d landing_step_px = LandingStepPx(camera, grid);
  const auto width = static_cast<std::size_t>(width_px);
  std::vector<float> falloff(width * static_cast<std::size_t>(height_px));
  model::ParallelFor(height_px, threads, [&](int y) {
    float* row = falloff.data() + static_cast<std::size_t>(y) * width;
    for (int x = 0; x < width_px; ++x) {
      row[x] =
          static_cast<float>(MeanIrradianceAt(grid, camera, weights, landing_step_px, x, y) / unit);
    }
  });
  return falloff;
}

}  // namespace thicklens::estimator
