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

// Rows of the photograph that are summed together.
constexpr int kBandRows = 32;

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
    : picture_(picture), irradiance_(std::move(irradiance)), threads_(threads) {
  SetInverseSums();
}

namespace {

// What the rays of one column (row) of views put on the pixels [begin, end).
struct Reach {
  int begin = 0, end = 0;
  std::size_t of_views = 0;
  double share = 0;
};

// The pixels 0 to `count_px` - 1 between the borders of what reaches them.
template <typename Run>
std::vector<Run> RunsOf(int count_px, int views, const std::vector<Reach>& reaches) {
  std::set<int> borders{0, count_px};
  for (const Reach& reach : reaches) {
    if (reach.begin < reach.end) borders.insert({reach.begin, reach.end});
  }
  std::vector<Run> runs;
  for (auto border = borders.begin(); std::next(border) != borders.end(); ++border) {
    Run run{*border, *std::next(border), std::vector<double>(Index(views))};
    for (const Reach& reach : reaches) {
      if (reach.begin <= run.begin && run.end <= reach.end)
        run.shares[reach.of_views] += reach.share;
    }
    runs.push_back(std::move(run));
  }
  return runs;
}

}  // namespace

template <typename Real>
std::vector<typename GridPhotograph<Real>::Run> GridPhotograph<Real>::Columns() const {
  std::vector<Reach> reaches;
  for (int k = 0; k < picture_.u_count; ++k) {
    const LandingRect rect = LandingIn(picture_, k, 0);
    for (const Tap& tap : TapsOf(picture_.s_fraction[Index(k)])) {
      reaches.push_back({std::max(0, rect.x_begin - tap.offset),
                         std::min(picture_.width_px, rect.x_end - tap.offset), Index(k),
                         tap.share});
    }
  }
  return RunsOf<Run>(picture_.width_px, picture_.u_count, reaches);
}

template <typename Real>
std::vector<typename GridPhotograph<Real>::Run> GridPhotograph<Real>::Rows() const {
  std::vector<Reach> reaches;
  for (int l = 0; l < picture_.v_count; ++l) {
    const LandingRect rect = LandingIn(picture_, 0, l);
    for (const Tap& tap : TapsOf(picture_.t_fraction[Index(l)])) {
      reaches.push_back({std::max(0, rect.y_begin - tap.offset),
                         std::min(picture_.height_px, rect.y_end - tap.offset), Index(l),
                         tap.share});
    }
  }
  return RunsOf<Run>(picture_.height_px, picture_.v_count, reaches);
}

template <typename Real>
void GridPhotograph<Real>::SetInverseSums() {
  const std::vector<Run> columns = Columns();
  for (const Run& column : columns) column_ends_.push_back(column.end);
  for (const Run& row : Rows()) {
    run_of_row_.resize(Index(row.end), inverse_sums_.size());
    std::vector<Real>& of_columns = inverse_sums_.emplace_back();
    for (const Run& column : columns) {
      double sum = 0;
      for (int view = 0; view < picture_.views(); ++view) {
        sum += picture_.view_weight[Index(view)] * row.shares[Index(view / picture_.u_count)] *
               column.shares[Index(view % picture_.u_count)];
      }
      of_columns.push_back(sum > 0 ? static_cast<Real>(1 / sum) : Real{0});
    }
  }
}

template <typename Real>
void GridPhotograph<Real>::Normalise(int y, const Real* from, Real* to) const {
  const std::vector<Real>& inverse = inverse_sums_[run_of_row_[Index(y)]];
  int x = 0;
  for (std::size_t run = 0; run < inverse.size(); ++run) {
    for (; x < column_ends_[run]; ++x) to[x] = inverse[run] * from[x];
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
  double sum = static_cast<double>(pixels() * sizeof(Real));  // scaled for the transpose
  for (const auto& view : irradiance_) {
    sum += static_cast<double>(view.capacity() * sizeof(float));
  }
  return sum;
}

template class GridPhotograph<float>;
template class GridPhotograph<double>;

}  // namespace thicklens::estimator
