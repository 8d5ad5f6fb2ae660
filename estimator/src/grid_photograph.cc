#include "grid_photograph.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "grid_loops.h"
#include "thicklens/model/parallel.h"

namespace thicklens::estimator {
namespace {

// Rows of the photograph that are summed together.
constexpr int kBandRows = 8;

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

}  // namespace

LandingRect LandingIn(const kernels::BlockGeometry& picture, int k, int l) {
  const int s_shift = picture.s_shift[Index(k)], t_shift = picture.t_shift[Index(l)];
  return {std::max(0, s_shift), std::min(picture.width_px, picture.s_count + s_shift),
          std::max(0, t_shift), std::min(picture.height_px, picture.t_count + t_shift)};
}

// A ray that lands f beside the pixel nearest to it gives that 1 - |f|, and |f| to the next one on
// that side.
template <typename Real>
std::array<typename GridPhotograph<Real>::Tap, 2> GridPhotograph<Real>::TapsOf(double fraction) {
  return {Tap{0, 1 - std::abs(fraction)}, Tap{fraction > 0 ? -1 : 1, std::abs(fraction)}};
}

template <typename Real>
template <typename Visit>
void GridPhotograph<Real>::ForRow(int k, int l, const Tap& in_y, int y, const Visit& visit) const {
  const LandingRect rect = LandingIn(picture_, k, l);
  const int ray_y = y + in_y.offset;
  if (y < 0 || y >= picture_.height_px || ray_y < rect.y_begin || ray_y >= rect.y_end) return;
  const int t = ray_y - picture_.t_shift[Index(l)];
  for (const Tap& in_x : TapsOf(picture_.s_fraction[Index(k)])) {
    const double weight =
        picture_.view_weight[Index(l * picture_.u_count + k)] * in_y.share * in_x.share;
    const int begin = std::max(0, rect.x_begin - in_x.offset);
    const int end = std::min(picture_.width_px, rect.x_end - in_x.offset);
    if (!(weight > 0) || begin >= end) continue;
    const int s = begin + in_x.offset - picture_.s_shift[Index(k)];
    visit(static_cast<Real>(weight), Index(begin), Index(end - begin),
          Index(t) * Index(picture_.s_count) + Index(s));
  }
}

template <typename Real>
GridPhotograph<Real>::GridPhotograph(const kernels::BlockGeometry& picture,
                                     std::vector<std::vector<float>> irradiance, int threads)
    : picture_(picture),
      irradiance_(std::move(irradiance)),
      threads_(threads),
      inverse_sums_(Index(picture.pixels())) {
  model::ParallelFor(picture_.height_px, threads_, [&](int y) {
    Real* sums = inverse_sums_.data() + Index(y) * Index(picture_.width_px);
    for (int view = 0; view < picture_.views(); ++view) {
      const int k = view % picture_.u_count, l = view / picture_.u_count;
      for (const Tap& in_y : TapsOf(picture_.t_fraction[Index(l)])) {
        ForRow(k, l, in_y, y, [&](Real weight, std::size_t x, std::size_t count, std::size_t) {
          for (std::size_t i = x; i < x + count; ++i) sums[i] += weight;
        });
      }
    }
    for (int x = 0; x < picture_.width_px; ++x) sums[x] = sums[x] > 0 ? 1 / sums[x] : Real{0};
  });
}

template <typename Real>
const float* GridPhotograph<Real>::IrradianceFrom(int view, std::size_t sample) const {
  return irradiance_.empty() ? nullptr : irradiance_[Index(view)].data() + sample;
}

template <typename Real>
void GridPhotograph<Real>::Apply(const Real* rays, Real* photograph) const {
  const std::size_t width = Index(picture_.width_px);
  const std::size_t view_size = Index(picture_.s_count) * Index(picture_.t_count);
  const int bands = (picture_.height_px + kBandRows - 1) / kBandRows;
  model::ParallelFor(bands, threads_, [&](int band) {
    const int first = band * kBandRows, last = std::min(picture_.height_px, first + kBandRows);
    std::fill(photograph + Index(first) * width, photograph + Index(last) * width, Real{0});
    for (int view = 0; view < picture_.views(); ++view) {
      const int k = view % picture_.u_count, l = view / picture_.u_count;
      for (int y = first; y < last; ++y) {
        Real* row = photograph + Index(y) * width;
        for (const Tap& in_y : TapsOf(picture_.t_fraction[Index(l)])) {
          ForRow(k, l, in_y, y,
                 [&](Real weight, std::size_t x, std::size_t count, std::size_t sample) {
                   AddProducts(weight, IrradianceFrom(view, sample),
                               rays + Index(view) * view_size + sample, count, row + x);
                 });
        }
      }
    }
    for (std::size_t i = Index(first) * width; i < Index(last) * width; ++i) {
      photograph[i] *= inverse_sums_[i];
    }
  });
}

template <typename Real>
void GridPhotograph<Real>::AddTransposed(const Real* photograph, Real* rays) const {
  const std::size_t width = Index(picture_.width_px);
  const std::size_t view_size = Index(picture_.s_count) * Index(picture_.t_count);
  std::vector<Real> scaled(inverse_sums_.size());
  for (std::size_t i = 0; i < scaled.size(); ++i) scaled[i] = photograph[i] * inverse_sums_[i];
  // A view at a time: no two of them share a ray.
  model::ParallelFor(picture_.views(), threads_, [&](int view) {
    const int k = view % picture_.u_count, l = view / picture_.u_count;
    for (int y = 0; y < picture_.height_px; ++y) {
      const Real* row = scaled.data() + Index(y) * width;
      for (const Tap& in_y : TapsOf(picture_.t_fraction[Index(l)])) {
        ForRow(k, l, in_y, y,
               [&](Real weight, std::size_t x, std::size_t count, std::size_t sample) {
                 AddProducts(weight, IrradianceFrom(view, sample), row + x, count,
                             rays + Index(view) * view_size + sample);
               });
      }
    }
  });
}

template <typename Real>
double GridPhotograph<Real>::bytes() const {
  // Twice: scaled for the transpose.
  double sum = static_cast<double>(2 * inverse_sums_.capacity() * sizeof(Real));
  for (const auto& view : irradiance_) {
    sum += static_cast<double>(view.capacity() * sizeof(float));
  }
  return sum;
}

template class GridPhotograph<float>;
template class GridPhotograph<double>;

}  // namespace thicklens::estimator
