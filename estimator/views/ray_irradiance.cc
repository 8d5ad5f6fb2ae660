#include "estimator/views/ray_irradiance.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "estimator/views/ray_landing.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

double IrradianceOf(const model::Camera& camera, const model::LightFieldGrid& grid,
                    const model::Ray& ray) {
  return model::RelativeIrradiance(camera.lens, camera.image_distance_mm(), grid.planes, ray);
}

// Returns the irradiance of the ray of view (k, l) that lands at the principal point: P s = Q u by
// [S16], so s = Q u/P; s = 0 with ST in the plane of focus.
double IrradianceAtPrincipalPoint(const model::LightFieldGrid& grid, const model::Camera& camera,
                                  int k, int l) {
  const model::ProjectionCoefficients projection =
      model::ProjectionOf(camera.lens, camera.image_distance_mm(), grid.planes);
  const double s_per_u = projection.q / projection.p;
  model::Ray ray = grid.RayAt(0, 0, k, l);
  ray.s_mm = s_per_u * ray.u_mm;
  ray.t_mm = s_per_u * ray.v_mm;
  return IrradianceOf(camera, grid, ray);
}

// Returns one over the irradiance at the principal point of every view, V x U.
Eigen::ArrayXXd Exposures(const model::LightFieldGrid& grid, const model::Camera& camera) {
  Eigen::ArrayXXd exposures(grid.v_count, grid.u_count);
  for (int l = 0; l < grid.v_count; ++l) {
    for (int k = 0; k < grid.u_count; ++k)
      exposures(l, k) = 1 / IrradianceAtPrincipalPoint(grid, camera, k, l);
  }
  return exposures;
}

// Returns the number of samples from a pixel to the ray of view k that lands nearest to it.
int NearestRayShift(double landing_step_px, int k, int count) {
  return -static_cast<int>(std::floor(landing_step_px * (k - (count - 1) / 2.0) + 0.5));
}

// tan^2 of alpha and beta for rays in the plane of one axis; samples x positions on the aperture.
struct SquaredSlopes {
  Eigen::ArrayXXd alpha, beta;
};

// `ray_of(i, k)`: the ray of sample i and position k whose coordinates on the other axis are 0.
template <typename RayOf>
SquaredSlopes SlopesOnAxis(const model::LightFieldGrid& grid, const model::Camera& camera,
                           int samples, int positions, const RayOf& ray_of) {
  const auto squared_tangent = [](double cosine) { return 1 / (cosine * cosine) - 1; };
  const double image_distance_mm = camera.image_distance_mm();
  SquaredSlopes slopes{Eigen::ArrayXXd(samples, positions), Eigen::ArrayXXd(samples, positions)};
  for (int k = 0; k < positions; ++k) {
    for (int i = 0; i < samples; ++i) {
      const model::Ray ray = ray_of(i, k);
      slopes.alpha(i, k) = squared_tangent(model::CosAlpha(grid.planes, ray));
      slopes.beta(i, k) =
          squared_tangent(model::CosBeta(camera.lens, image_distance_mm, grid.planes, ray));
    }
  }
  return slopes;
}

// [S12] for rows of rays. The tangent of an angle to the axis is the hypotenuse of the tangents in
// the planes of the two axes, so that two tables are sufficient.
class RowIrradiance {
 public:
  RowIrradiance(const model::LightFieldGrid& grid, const model::Camera& camera)
      : across_(SlopesOnAxis(grid, camera, grid.s_count, grid.u_count,
                             [&](int i, int k) {
                               const model::Ray ray = grid.RayAt(i, 0, k, 0);
                               return model::Ray{ray.s_mm, 0, ray.u_mm, 0};
                             })),
        down_(SlopesOnAxis(grid, camera, grid.t_count, grid.v_count, [&](int j, int l) {
          const model::Ray ray = grid.RayAt(0, j, 0, l);
          return model::Ray{0, ray.t_mm, 0, ray.v_mm};
        })) {}

  // Returns the irradiance of `count` rays (i, j, k, l) from i = `first` on.
  Eigen::ArrayXd Of(int first, int count, int j, int k, int l) const {
    const auto alpha = across_.alpha.col(k).segment(first, count) + (1 + down_.alpha(j, l));
    const auto beta = across_.beta.col(k).segment(first, count) + (1 + down_.beta(j, l));
    return 1 / ((alpha * beta).sqrt() * beta);
  }

 private:
  SquaredSlopes across_, down_;
};

// Returns the mean over the rays of all views that land nearest to the pixel (x, y), whether they
// are samples of the grid or not.
double MeanIrradianceAt(const model::LightFieldGrid& grid, const model::Camera& camera,
                        const Eigen::ArrayXXd& weights, const Eigen::ArrayXXd& exposures,
                        const Eigen::Vector2d& landing_step_px, int x, int y) {
  double sum = 0;
  for (int l = 0; l < grid.v_count; ++l) {
    const int j = y + NearestRayShift(landing_step_px.y(), l, grid.v_count);
    for (int k = 0; k < grid.u_count; ++k) {
      if (weights(l, k) == 0) continue;
      const int i = x + NearestRayShift(landing_step_px.x(), k, grid.u_count);
      sum += weights(l, k) * exposures(l, k) * IrradianceOf(camera, grid, grid.RayAt(i, j, k, l));
    }
  }
  return sum / weights.sum();
}

}  // namespace

void CheckViewWeights(const model::LightFieldGrid& grid, const Eigen::ArrayXXd& weights) {
  if (weights.cols() != grid.u_count || weights.rows() != grid.v_count) {
    throw Error(fmt::format("weights are {}x{} for {}x{} views: the counts must be equal",
                            weights.cols(), weights.rows(), grid.u_count, grid.v_count));
  }
  if (!(weights >= 0).all() || !(weights.sum() > 0)) {
    throw Error(
        fmt::format("weights of the views: their sum is {}: each must be >= 0 and at least one > 0",
                    weights.sum()));
  }
}

std::vector<float> RelativeFalloff(const model::LightFieldGrid& grid, const model::Camera& camera,
                                   const Eigen::ArrayXXd& weights, int k, int l) {
  CheckViewWeights(grid, weights);
  const double unit = IrradianceAtPrincipalPoint(grid, camera, k, l);
  const RowIrradiance irradiance(grid, camera);
  const auto width = static_cast<std::size_t>(grid.s_count);
  std::vector<float> falloff(width * static_cast<std::size_t>(grid.t_count));
  for (int j = 0; j < grid.t_count; ++j) {
    Eigen::Map<Eigen::ArrayXf>(falloff.data() + static_cast<std::size_t>(j) * width, grid.s_count) =
        (irradiance.Of(0, grid.s_count, j, k, l) / unit).cast<float>();
  }
  return falloff;
}

std::vector<float> FalloffOfImage(const model::LightFieldGrid& grid, const model::Camera& camera,
                                  const Eigen::ArrayXXd& weights, int width_px, int height_px,
                                  int threads) {
  CheckViewWeights(grid, weights);
  const Eigen::ArrayXXd exposures = Exposures(grid, camera);
  const Eigen::Vector2d landing_step_px = LandingStepPx(camera, grid);
  const RowIrradiance irradiance(grid, camera);
  const auto width = static_cast<std::size_t>(width_px);
  std::vector<float> falloff(width * static_cast<std::size_t>(height_px));
  ParallelFor(height_px, threads, [&](int y) {
    // Sums for each pixel over the rays that are samples of the grid.
    Eigen::ArrayXd sum = Eigen::ArrayXd::Zero(width_px), weight = sum;
    for (int l = 0; l < grid.v_count; ++l) {
      const int j = y + NearestRayShift(landing_step_px.y(), l, grid.v_count);
      if (j < 0 || j >= grid.t_count) continue;
      for (int k = 0; k < grid.u_count; ++k) {
        const int shift = NearestRayShift(landing_step_px.x(), k, grid.u_count);
        const int first = std::max(0, -shift), last = std::min(width_px, grid.s_count - shift);
        if (weights(l, k) == 0 || first >= last) continue;
        sum.segment(first, last - first) +=
            weights(l, k) * exposures(l, k) * irradiance.Of(first + shift, last - first, j, k, l);
        weight.segment(first, last - first) += weights(l, k);
      }
    }
    float* const row = falloff.data() + static_cast<std::size_t>(y) * width;
    for (int x = 0; x < width_px; ++x) {
      const double mean =
          weight[x] > 0 ? sum[x] / weight[x]
                        : MeanIrradianceAt(grid, camera, weights, exposures, landing_step_px, x, y);
      row[x] = static_cast<float>(mean);
    }
  });
  return falloff;
}

}  // namespace thicklens::estimator
