#ifndef THICKLENS_ESTIMATOR_PROJECTION_SCENE_RAYS_H_
#define THICKLENS_ESTIMATOR_PROJECTION_SCENE_RAYS_H_

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/ray_loops.h"

namespace thicklens::estimator {

// The rays of one view: the position in the centre view of each sample's source.
template <typename Real>
class ViewRays {
 public:
  ViewRays() = default;
  // `lowest` and `highest`: minimum and maximum disparity of the 2 x 2 pixels from each pixel to
  // the right and down.
  ViewRays(const DisparityMap& map, const std::vector<float>& lowest,
           const std::vector<float>& highest, const ViewDisparity& view, double a, double b);

  // Count of extra numbers that a row of values, and an image, needs after its last one.
  static constexpr std::size_t kMargin = 2 * kernels::kRaysTogether;

  // Computes warped(x) = sum_taps t(x, p) image(p) of one row, by the taps of SurfaceTaps.
  void Warp(int row, const Real* image, Real* warped) const;
  // Adds the transpose to the image. `values` is overwritten.
  void Spread(int row, Real* values, Real* image) const;

  double bytes() const;

 private:
  // A ray with a source at a border, past an edge, or in a cell of more than one surface.
  struct OddRay {
    std::int32_t x = 0;
    std::array<std::int32_t, 4> pixel{};
    std::array<Real, 4> weight{};
  };
  // A ray that keeps the share `rest` and also reads another place.
  struct BoundaryRay {
    OddRay other;
    Real rest = 0;
  };
  OddRay OddRayOf(const DisparityMap& map, double tolerance, std::size_t sample,
                  const kernels::OccludedSample& source) const;
  void AddBoundaryRays(const DisparityMap& map, double tolerance, const ViewDisparity& view);
  kernels::RayRow<Real> RowOf(int row) const;

  int width_px_ = 0;
  Real shift_x_ = 0, shift_y_ = 0;
  std::vector<Real> disparity_;
  std::vector<kernels::RayRun> runs_;
  std::vector<OddRay> odd_;
  std::vector<BoundaryRay> boundary_;
  std::vector<std::size_t> run_start_, odd_start_, mixed_start_;  // start of each row, and the end
};

// H in scene-ray form. R(p, k) is the radiance of the scene point that the pixel p of the centre
// view shows, toward the aperture sample k;
//
//   (H R)(x) = sum_k w_k sum_taps t_k(x, p) R(p, k),
//
// with the rays of SceneProjection and its taps for Between::kLinear. Where all R(p, k) of a point
// are equal, this is its photograph. Derived here [D114]. A plane R(., k) starts at k * stride,
// with k row by row of the aperture.
template <typename Real>
class SceneRays {
 public:
  // `disparity`: px per view step, 0 in the plane of focus, without holes. The weights are V x U
  // with sum 1. `progress` is called for each view, from any thread, and may throw to stop.
  SceneRays(const DisparityMap& disparity, const Eigen::ArrayXXd& weights, int threads,
            const std::function<void()>& progress);

  std::size_t pixels() const {
    return static_cast<std::size_t>(width_px_) * static_cast<std::size_t>(height_px_);
  }
  // Distance from plane to plane: the pixels and the margin that the loops need after them.
  std::size_t plane_stride() const;
  std::size_t view_count() const { return views_.size(); }

  // photograph = H R. Stride 0: all planes are the same one.
  void Apply(const Real* planes, std::size_t stride, Real* photograph);
  // R = H^T photograph; the planes are plane_stride() apart, and their margins become 0.
  void ApplyTransposed(const Real* photograph, Real* planes);
  // Computes what view k shows of its plane (which has a margin), without the weight.
  void Show(std::size_t k, const Real* plane, float* shown) const;

  double bytes() const;

 private:
  int width_px_ = 0, height_px_ = 0;
  int threads_ = 1;
  std::vector<ViewRays<Real>> views_;
  std::vector<Real> weights_;
  std::vector<Real> rows_;  // one row with a margin for each piece of work
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_PROJECTION_SCENE_RAYS_H_
