#ifndef THICKLENS_ESTIMATOR_PROJECTION_SCENE_PROJECTION_H_
#define THICKLENS_ESTIMATOR_PROJECTION_SCENE_PROJECTION_H_

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

#include "estimator/projection/angular_bundle.h"
#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/image_filter.h"

namespace thicklens::estimator {

// H of a scene whose points look the same from everywhere. It maps the radiance r of the points
// that the centre view shows to the photograph; each pixel is a mean of the points that the views
// see through it:
//
//   (H r)(x) = sum_k w_k r(x + s_k(x)) [D100],
//
// where s_k is the displacement from the view's sample to its source (ViewDisparity). A source is
// read by those of its bilinear taps that are on its surface, and a boundary sample by the taps of
// both surfaces. Rows sum to 1.
//
// A pixel whose bundle meets only one surface is computed by filters down and across the image.
// They treat the bundle as a product of its axes (weights that are no product are a sum of
// products, by singular values) and may read bicubic, as views are shown. A pixel where the product
// would misplace a ray by more than a tolerance has a row of its own. There taps cost more, and
// their refinement would be lost in the effect of the edge beside the pixel. Derived here. Images
// are `channels` planes of width * height numbers.
template <typename Real>
class SceneProjection {
 public:
  // One product of weights: (x -> sum_n across_n) then (sum_m down_m).
  struct Term {
    kernels::VaryingFilter<Real> across, down;
  };

  int width_px = 0, height_px = 0;
  int threads = 1;
  std::vector<Term> terms;  // empty: every pixel has a row
  kernels::PixelBlockedCsr<Real> rows;
  // Share of the aperture, 0 to 1, that sees each pixel through samples hidden from the centre
  // view; a boundary sample counts by its hidden share.
  std::vector<float> occluded_fraction;
  // Share of the aperture that sees each point of the centre view; only if requested.
  std::vector<float> visible_fraction;
  AngularBundle bundle;     // only if requested; without the centre
  double bundle_bytes = 0;  // memory of the whole bundle while H was made

  // Both functions set their results.
  void Apply(const Real* x, int channels, Real* y) const;
  void ApplyTransposed(const Real* y, int channels, Real* x) const;

  std::size_t pixels() const {
    return static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  }
  // Share of the photograph's pixels that have a row of their own.
  double row_share() const;
  // These two functions count the rows [first, last) of the photograph alone.
  std::size_t pixels_with_row(int first_row, int last_row) const;
  double bytes(int first_row, int last_row) const;

 private:
  std::pair<std::size_t, std::size_t> RowsOfOwn(int first_row, int last_row) const;

  mutable std::vector<Real> between_, other_;
};

struct ProjectionOptions {
  double tolerance_px =
      0.2;  // largest error of a ray's position where the bundle is treated as a product
  Interpolation interpolation =
      Interpolation::kCubic;      // interpolation of the products; rows are linear
  bool visible_fraction = false;  // true: compute visible_fraction
  bool bundle = false;            // true: keep the bundle
  int threads = 1;
  std::function<void()> progress;  // called repeatedly, from any thread; may throw to stop
  std::function<void()> freed;     // called, from any thread, when much memory was freed
};
// Makes H. `disparity` is that of the rays that meet on the photograph's pixels: px per view step,
// 0 in the plane of focus, without holes. The weights are V x U with sum 1. Throws Error for sizes
// that do not fit.
template <typename Real>
SceneProjection<Real> MakeSceneProjection(const DisparityMap& disparity,
                                          const Eigen::ArrayXXd& weights,
                                          const ProjectionOptions& options);

// Converts the disparity of the samples of a grid to the photograph's disparity. A ray of the view
// a lands q a px beside its sample, so the result is D - q per axis, with D the displacement per
// view. Derived here [D20]: the sample i = p - D a of the point p lands at i + q a. Throws Error if
// the axes require different offsets.
DisparityMap PhotographDisparity(const DisparityMap& on_grid,
                                 const Eigen::Vector2d& landing_step_px);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_PROJECTION_SCENE_PROJECTION_H_
