#include "grid_photograph.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <set>
#include <utility>

#include "grid_loops.h"
#include "thicklens/model/parallel.h"

namespace thicklens::estimator {
namespace {

// Rows of the photograph that are summed together: of each view so many one after the other, as
// memory is read fastest; fewer where else threads would have nothing to do.
constexpr int kMostBandRows = 32;

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

// A ray that lands f beside the pixel nearest to it gives that 1 - |f|, and |f| to the next one on
// that side.
std::array<RayTap, 2> TapsOf(double fraction) {
  return {RayTap{0, 1 - std::abs(fraction)}, RayTap{fraction > 0 ? -1 : 1, std::abs(fraction)}};
}

// Neighbouring columns (rows) of the picture that the columns (rows) of views reach alike.
struct Run {
  int end = 0;
  std::vector<double> shares;  // of a pixel in the rays of each
};

// Of the pixels 0 to `count_px` - 1, from samples 0 to `samples` - 1 of each column of views.
std::vector<Run> RunsOf(int count_px, int samples, const std::vector<int>& shifts,
                        const std::vector<double>& fractions) {
  struct Reach {
    int begin = 0, end = 0;
    std::size_t of_views = 0;
    double share = 0;
  };
  std::vector<Reach> reaches;
  std::set<int> borders{0, count_px};
  for (std::size_t k = 0; k < shifts.size(); ++k) {
    const int first = std::max(0, shifts[k]), last = std::min(count_px, samples + shifts[k]);
    for (const RayTap& tap : TapsOf(fractions[k])) {
      const Reach reach{std::max(0, first - tap.offset), std::min(count_px, last - tap.offset), k,
                        tap.share};
      if (!(reach.share > 0) || reach.begin >= reach.end) continue;
      reaches.push_back(reach);
      borders.insert({reach.begin, reach.end});
    }
  }
  std::vector<Run> runs;
  for (auto border = borders.begin(); std::next(border) != borders.end(); ++border) {
    Run run{*std::next(border), std::vector<double>(shifts.size())};
    for (const Reach& reach : reaches) {
      if (reach.begin <= *border && run.end <= reach.end) {
        run.shares[reach.of_views] += reach.share;
      }
    }
    runs.push_back(std::move(run));
  }
  return runs;
}

}  // namespace

LandingRect LandingIn(const kernels::BlockGeometry& picture, int k, int l) {
  const int s_shift = picture.s_shift[Index(k)], t_shift = picture.t_shift[Index(l)];
  return {std::max(0, s_shift), std::min(picture.width_px, picture.s_count + s_shift),
          std::max(0, t_shift), std::min(picture.height_px, picture.t_count + t_shift)};
}

template <typename Real>
template <typename Visit>
void GridPhotograph<Real>::ForRow(int k, int l, const RayTap& in_y, int y,
                                  const Visit& visit) const {
  const LandingRect rect = LandingIn(picture_, k, l);
  const int ray_y = y + in_y.offset;
  if (y < 0 || y >= picture_.height_px || ray_y < rect.y_begin || ray_y >= rect.y_end) return;
  const int t = ray_y - picture_.t_shift[Index(l)];
  for (const RayTap& in_x : TapsOf(picture_.s_fraction[Index(k)])) {
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
    : picture_(picture), irradiance_(std::move(irradiance)), threads_(threads) {
  SetInverseSums();
}

template <typename Real>
void GridPhotograph<Real>::SetInverseSums() {
  const std::vector<Run> columns =
      RunsOf(picture_.width_px, picture_.s_count, picture_.s_shift, picture_.s_fraction);
  for (const Run& column : columns) column_ends_.push_back(column.end);
  for (const Run& row :
       RunsOf(picture_.height_px, picture_.t_count, picture_.t_shift, picture_.t_fraction)) {
    run_of_row_.resize(Index(row.end), inverse_sums_.size());
    std::vector<Real>& of_columns = inverse_sums_.emplace_back();
    for (const Run& column : columns) {
      double sum = 0;
      for (int view = 0; view < picture_.views(); ++view) {
        sum += picture_.view_weight[Index(view)] * row.shares[Index(view / picture_.u_count)] *
               column.shares[Index(view % picture_.u_count)];
      }
      // As real as the weights that Apply takes: what is 0 there has no inverse.
      const Real real_sum = static_cast<Real>(sum);
      of_columns.push_back(real_sum > 0 ? 1 / real_sum : Real{0});
    }
  }
}

template <typename Real>
void GridPhotograph<Real>::Normalise(int y, const Real* from, Real* to) const {
  const std::vector<Real>& inverse_sums = inverse_sums_[run_of_row_[Index(y)]];
  int x = 0;
  for (std::size_t run = 0; run < inverse_sums.size(); ++run) {
    const Real inverse = inverse_sums[run];
    for (const int end = column_ends_[run]; x < end; ++x) to[x] = inverse * from[x];
  }
}

template <typename Real>
const float* GridPhotograph<Real>::IrradianceFrom(int view, std::size_t sample) const {
  return irradiance_.empty() ? nullptr : irradiance_[Index(view)].data() + sample;
}

template <typename Real>
void GridPhotograph<Real>::Apply(const Real* rays, Real* photograph) const {
  const std::size_t width = Index(picture_.width_px);
  const std::size_t view_size = Index(picture_.s_count) * Index(picture_.t_count);
  const int threads = model::ResolveThreads(threads_);
  const int band_rows = std::clamp((picture_.height_px + threads - 1) / threads, 1, kMostBandRows);
  const int bands = (picture_.height_px + band_rows - 1) / band_rows;
  model::ParallelFor(bands, threads_, [&](int band) {
    const int first = band * band_rows, last = std::min(picture_.height_px, first + band_rows);
    std::fill(photograph + Index(first) * width, photograph + Index(last) * width, Real{0});
    for (int view = 0; view < picture_.views(); ++view) {
      const int k = view % picture_.u_count, l = view / picture_.u_count;
      for (int y = first; y < last; ++y) {
        Real* row = photograph + Index(y) * width;
        for (const RayTap& in_y : TapsOf(picture_.t_fraction[Index(l)])) {
          ForRow(k, l, in_y, y,
                 [&](Real weight, std::size_t x, std::size_t count, std::size_t sample) {
                   AddProducts(weight, IrradianceFrom(view, sample),
                               rays + Index(view) * view_size + sample, count, row + x);
                 });
        }
      }
    }
    for (int y = first; y < last; ++y) {
      Real* row = photograph + Index(y) * width;
      Normalise(y, row, row);
    }
  });
}

template <typename Real>
void GridPhotograph<Real>::AddTransposed(const Real* photograph, Real* rays) const {
  const std::size_t width = Index(picture_.width_px);
  const std::size_t view_size = Index(picture_.s_count) * Index(picture_.t_count);
  std::vector<Real> scaled(pixels());
  for (int y = 0; y < picture_.height_px; ++y) {
    Normalise(y, photograph + Index(y) * width, scaled.data() + Index(y) * width);
  }
  // A view at a time: no two of them share a ray.
  model::ParallelFor(picture_.views(), threads_, [&](int view) {
    const int k = view % picture_.u_count, l = view / picture_.u_count;
    for (int y = 0; y < picture_.height_px; ++y) {
      const Real* row = scaled.data() + Index(y) * width;
      for (const RayTap& in_y : TapsOf(picture_.t_fraction[Index(l)])) {
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
  double sum = static_cast<double>(pixels() * sizeof(Real));  // scaled for the transpose
  for (const auto& view : irradiance_) {
    sum += static_cast<double>(view.capacity() * sizeof(float));
  }
  return sum;
}

template class GridPhotograph<float>;
template class GridPhotograph<double>;

}  // namespace thicklens::estimator
