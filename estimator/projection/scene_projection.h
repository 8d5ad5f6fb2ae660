#ifndef THICKLENS_ESTIMATOR_PROJECTION_SCENE_PROJECTION_H_
#define THICKLENS_ESTIMATOR_PROJECTION_SCENE_PROJECTION_H_

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

#include "estimator/projection/view_fan.h"
#include "thicklens/estimator/view_geometry.h"
#include "thicklens/kernels/picture_filter.h"

namespace thicklens::estimator {

// H of a scene whose points look the same from everywhere: from the radiance r of the points that
// the centre view shows to the photograph, each pixel a mean of what the views see through it:
//   (H r)(x) = sum_k w_k r(x + s_k(x)) [D100], s_k the way from the view's sample to its source
// (ViewDisparity), by the bilinear taps of the source that lie on its surface, and of mixed samples
// by those of both surfaces. Rows sum to 1.
// A pixel whose fan meets one surface only is computed by filters down and across the picture,
// which take the fan for a product of its axes (weights that are no product are a sum of such, by
// singular values), and which may read bicubic, as views are shown; a pixel where that would
// misplace a ray by more than a tolerance has a row of its own, where taps cost more and are lost
// in what the edge beside it does.
// Derived here.
// Pictures: `channels` planes of width * height numbers.
template <typename Real>
class SceneProjection {
 public:
  // One product of weights: (x -> sum_n across_n) then (sum_m down_m).
  struct Term {
    kernels::PixelFilter<Real> across, down;
  };

  int width_px = 0, height_px = 0;
  int threads = 1;
  std::vector<Term> terms;  // none: every pixel has a row
  kernels::PixelRuns<Real> rows;
  // Share of the aperture that sees each pixel through samples hidden from the centre view, or
  // through the share of samples that is, 0 to 1.
  std::vector<float> hidden_share;
  // Share of the aperture that sees each point of the centre view; only where it was asked for.
  std::vector<float> seen_share;
  ViewFan fan;           // likewise; without the centre
  double fan_bytes = 0;  // what all of it took while this was made

  // Both set their results.
  void Apply(const Real* x, int channels, Real* y) const;
  void ApplyTransposed(const Real* y, int channels, Real* x) const;

  std::size_t pixels() const {
    return static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  }
  // Of the photograph's pixels, those with a row of their own.
  double row_share() const;
  // Of the rows [first, last) of the photograph alone.
  std::size_t pixels_with_row(int first_row, int last_row) const;
  double bytes(int first_row, int last_row) const;

 private:
  std::pair<std::size_t, std::size_t> RowsOfOwn(int first_row, int last_row) const;

  mutable std::vector<Real> between_, other_;
};

struct ProjectionOptions {
  double tolerance_px = 0.2;          // of a ray's place, where the fan is taken for a product
  Between between = Between::kCubic;  // of the products; rows are linear
  bool seen_share = false;            // is found, too
  bool fan = false;                   // is kept
  int threads = 1;
  std::function<void()> progress;  // called now and then, from any thread; may throw to stop
  std::function<void()> freed;     // called, from any thread, when much memory was freed
};
// `disparity` of the rays that meet on the photograph's pixels: px per view step, 0 in the plane of
// focus, without holes. Weights V x U, sum 1. Throws Error for sizes that do not fit.
template <typename Real>
SceneProjection<Real> MakeSceneProjection(const DisparityMap& disparity,
                                          const Eigen::ArrayXXd& weights,
                                          const ProjectionOptions& options);

// That disparity from the one of the samples of a grid, for which a ray of the view a lands q a px
// beside its sample: D - q per axis, D the displacement per view. Derived here [D20]: the sample i
// = p - D a of the point p lands at i + q a. Throws Error if the axes ask for different offsets.
DisparityMap PhotographDisparity(const DisparityMap& on_grid,
                                 const Eigen::Vector2d& landing_step_px);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_PROJECTION_SCENE_PROJECTION_H_
