#ifndef THICKLENS_ESTIMATOR_PROJECTION_GRID_PHOTOGRAPH_H_
#define THICKLENS_ESTIMATOR_PROJECTION_GRID_PHOTOGRAPH_H_

#include <cstddef>
#include <vector>

#include "thicklens/kernels/kernels.h"
#include "thicklens/kernels/photograph_loops.h"

namespace thicklens::estimator {

// The samples of a view that land nearest to a pixel of the photograph, expressed as pixels: sample
// (x - s_shift, y - t_shift).
struct LandingRect {
  int x_begin = 0, x_end = 0, y_begin = 0, y_end = 0;
};
LandingRect LandingIn(const kernels::BlockGeometry& image, int k, int l);

// H on the grid [M10], for a whole photograph. It maps the rays of a light field of one channel,
// stored at (l * u_count + k) * t_count * s_count + t * s_count + s, to the photograph,
//
//   (H L)(x) = sum over rays of E w g L / sum over rays of w g,
//
// where w is the weight of the view, g the share of the pixel in the ray (bilinear), and E the
// irradiance; the numbers are those of kernels::Kernels::WeightRays. Rays that land outside of the
// photograph are ignored.
template <typename Real>
class GridPhotograph {
 public:
  // `irradiance`: one value for each sample, per view; empty: 1. The block must be the whole
  // photograph.
  GridPhotograph(const kernels::BlockGeometry& image, std::vector<std::vector<float>> irradiance,
                 int threads);
  GridPhotograph(const GridPhotograph&) = delete;
  GridPhotograph& operator=(const GridPhotograph&) = delete;

  std::size_t pixels() const { return static_cast<std::size_t>(image_.pixels()); }

  // photograph = H L.
  void Apply(const Real* rays, Real* photograph) const;
  // L += H^T photograph.
  void AddTransposed(const Real* photograph, Real* rays) const;

  double bytes() const;

 private:
  std::size_t view_size() const {
    return static_cast<std::size_t>(image_.s_count) * static_cast<std::size_t>(image_.t_count);
  }
  std::size_t bytes_of_rays() const {
    return static_cast<std::size_t>(image_.views()) * view_size() * sizeof(Real);
  }
  // Width of the photograph with a frame of one pixel.
  std::size_t framed_width() const { return static_cast<std::size_t>(image_.width_px) + 2; }
  void SetTaps();
  // Adds the contributions of the views of row l to the rows `first` to `last` - 1 of the
  // photograph.
  void AddViews(int l, int first, int last, const Real* rays, Real* photograph) const;
  // Adds the contributions of `framed` to the rays of a view, for the samples t from `first` to
  // `last` - 1.
  void AddToView(int view, int first, int last, const Real* framed, Real* rays) const;
  // Multiplies by 1/(sum of w g), or by 0 where the sum is 0.
  void Normalise(int y, const Real* from, Real* to) const;

  kernels::BlockGeometry image_;
  std::vector<std::vector<float>> irradiance_;
  int threads_;
  // The views that have rays for a pixel, and 1/(sum of w g), change only at the borders of views.
  // They are therefore stored for each run of columns and every row of views, and for each run of
  // rows.
  std::vector<int> column_ends_;
  std::vector<std::vector<std::vector<kernels::PixelTap<Real>>>> taps_;
  std::vector<std::vector<Real>> inverse_sums_;
  std::vector<std::size_t> run_of_row_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_PROJECTION_GRID_PHOTOGRAPH_H_
