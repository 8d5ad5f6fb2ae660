#include "estimator/projection/grid_photograph.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <set>
#include <utility>

#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

// Rows of the photograph that one thread sums together. Each view's rows are read in succession,
// which is fastest for memory, while the photograph's rows stay in the processor's second cache.
constexpr int kMaxBandRows = 128, kMinBandRows = 8;
constexpr std::size_t kMaxBandBytes = 320 * 1024;
// Rows of rays that one thread adds to together.
constexpr int kMaxRayRows = 256;
// Starting a thread for less takes longer than it saves.
constexpr std::size_t kMinBytesOfThread = 3 * 1024 * 1024;

int BandRows(std::size_t bytes_of_row) {
  const std::size_t rows = kMaxBandBytes / std::max<std::size_t>(bytes_of_row, 1);
  return static_cast<int>(std::clamp<std::size_t>(rows, kMinBandRows, kMaxBandRows));
}

struct Rows {
  int count = 0;
  int most = 0;  // maximum count that one thread takes together
  std::size_t bytes = 0;
};

// Calls work(first, last) for bands of the rows; each thread gets the same number of bands.
template <typename Work>
void ForBalancedBands(const Rows& rows, int threads, const Work& work) {
  const int resolved = ResolveThreads(threads);
  const int rounds = (rows.count + rows.most * resolved - 1) / (rows.most * resolved);
  const int bands = std::min(rows.count, rounds * resolved);
  const auto begin = [&](int band) {
    return static_cast<int>(static_cast<std::int64_t>(rows.count) * band / bands);
  };
  const std::size_t useful = 1 + rows.bytes / kMinBytesOfThread;
  ParallelFor(bands, static_cast<int>(std::min(Index(resolved), useful)),
              [&](int band) { work(begin(band), begin(band + 1)); });
}

// A pixel gets `share` of a ray: the one that lands nearest to the pixel `offset` beside it.
struct RayTap {
  int offset = 0;
  double share = 0;  // 0: no contribution
};

// A ray that lands f beside the pixel nearest to it contributes 1 - |f| to that pixel and |f| to
// the next one on that side.
std::array<RayTap, 2> TapsOf(double fraction) {
  return {RayTap{0, 1 - std::abs(fraction)}, RayTap{fraction > 0 ? -1 : 1, std::abs(fraction)}};
}

// A column (row) of views whose rays reach a pixel.
struct Reach {
  int of_views = 0;
  RayTap tap;
  int begin = 0, end = 0;  // pixels
};

// Neighbouring columns (rows) of the photograph that the columns (rows) of views reach alike.
struct Run {
  int end = 0;
  std::vector<Reach> reaches;
};

// Returns the runs of the pixels 0 to `count_px` - 1, reached from the samples 0 to `samples` - 1
// of each column of views.
std::vector<Run> RunsOf(int count_px, int samples, const std::vector<int>& shifts,
                        const std::vector<double>& fractions) {
  std::vector<Reach> reaches;
  std::set<int> borders{0, count_px};
  for (int k = 0; k < static_cast<int>(shifts.size()); ++k) {
    const int first = std::max(0, shifts[Index(k)]);
    const int last = std::min(count_px, samples + shifts[Index(k)]);
    for (const RayTap& tap : TapsOf(fractions[Index(k)])) {
      const Reach reach{k, tap, std::max(0, first - tap.offset),
                        std::min(count_px, last - tap.offset)};
      if (!(tap.share > 0) || reach.begin >= reach.end) continue;
      reaches.push_back(reach);
      borders.insert({reach.begin, reach.end});
    }
  }
  std::vector<Run> runs;
  for (auto border = borders.begin(); std::next(border) != borders.end(); ++border) {
    Run run{*std::next(border), {}};
    std::copy_if(
        reaches.begin(), reaches.end(), std::back_inserter(run.reaches),
        [&](const Reach& reach) { return reach.begin <= *border && run.end <= reach.end; });
    runs.push_back(std::move(run));
  }
  return runs;
}

// Returns the shares of a pixel of the run in the rays of each of `count` columns (rows) of views.
std::vector<double> SharesOf(const Run& run, int count) {
  std::vector<double> shares(Index(count));
  for (const Reach& reach : run.reaches) shares[Index(reach.of_views)] += reach.tap.share;
  return shares;
}

}  // namespace

LandingRect LandingIn(const kernels::BlockGeometry& image, int k, int l) {
  const int s_shift = image.s_shift[Index(k)], t_shift = image.t_shift[Index(l)];
  return {std::max(0, s_shift), std::min(image.width_px, image.s_count + s_shift),
          std::max(0, t_shift), std::min(image.height_px, image.t_count + t_shift)};
}

template <typename Real>
GridPhotograph<Real>::GridPhotograph(const kernels::BlockGeometry& image,
                                     std::vector<std::vector<float>> irradiance, int threads)
    : image_(image), irradiance_(std::move(irradiance)), threads_(threads) {
  SetTaps();
}

template <typename Real>
void GridPhotograph<Real>::SetTaps() {
  const std::vector<Run> columns =
      RunsOf(image_.width_px, image_.s_count, image_.s_shift, image_.s_fraction);
  taps_.resize(Index(image_.v_count));
  std::vector<std::vector<double>> shares_of_columns;
  for (const Run& column : columns) {
    column_ends_.push_back(column.end);
    shares_of_columns.push_back(SharesOf(column, image_.u_count));
    for (int l = 0; l < image_.v_count; ++l) {
      std::vector<kernels::PixelTap<Real>>& taps = taps_[Index(l)].emplace_back();
      for (const Reach& reach : column.reaches) {
        const int k = reach.of_views, view = l * image_.u_count + k;
        const auto weight = static_cast<Real>(image_.view_weight[Index(view)] * reach.tap.share);
        if (!(weight > 0)) continue;
        taps.push_back({weight, Index(k) * view_size(),
                        static_cast<std::ptrdiff_t>(reach.tap.offset - image_.s_shift[Index(k)]),
                        irradiance_.empty() ? nullptr : irradiance_[Index(view)].data()});
      }
    }
  }
  for (const Run& row :
       RunsOf(image_.height_px, image_.t_count, image_.t_shift, image_.t_fraction)) {
    run_of_row_.resize(Index(row.end), inverse_sums_.size());
    std::vector<Real>& of_columns = inverse_sums_.emplace_back();
    const std::vector<double> shares_of_row = SharesOf(row, image_.v_count);
    for (const std::vector<double>& shares : shares_of_columns) {
      double sum = 0;
      for (int view = 0; view < image_.views(); ++view) {
        sum += image_.view_weight[Index(view)] * shares_of_row[Index(view / image_.u_count)] *
               shares[Index(view % image_.u_count)];
      }
      // The sum is rounded to Real like the weights that Apply uses: a sum that is 0 there has no
      // inverse.
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
void GridPhotograph<Real>::AddViews(int l, int first, int last, const Real* rays,
                                    Real* photograph) const {
  const LandingRect inside = LandingIn(image_, 0, l);
  const Real* const of_views = rays + Index(l) * Index(image_.u_count) * view_size();
  const std::array<RayTap, 2> taps = TapsOf(image_.t_fraction[Index(l)]);
  const int begin = std::max(inside.y_begin, first - 1);  // first pixel that rays land nearest to
  const int end = std::min(inside.y_end, last + 1);
  for (int ray_y = begin; ray_y < end; ++ray_y) {
    std::array<kernels::SharedRow<Real>, 2> rows;
    for (std::size_t i = 0; i < taps.size(); ++i) {
      const int y = ray_y - taps[i].offset;
      if (!(taps[i].share > 0) || y < first || y >= last) continue;
      rows[i] = {photograph + Index(y) * Index(image_.width_px), static_cast<Real>(taps[i].share)};
    }
    if (rows[0].pixels == nullptr && rows[1].pixels == nullptr) continue;
    const std::size_t row_start = Index(ray_y - image_.t_shift[Index(l)]) * Index(image_.s_count);
    int x = 0;
    for (std::size_t run = 0; run < column_ends_.size(); ++run) {
      kernels::AddTaps(taps_[Index(l)][run], of_views, row_start, Index(x),
                       Index(column_ends_[run]), rows);
      x = column_ends_[run];
    }
  }
}

template <typename Real>
void GridPhotograph<Real>::Apply(const Real* rays, Real* photograph) const {
  const std::size_t width = Index(image_.width_px);
  const Rows of_image{image_.height_px, BandRows(width * sizeof(Real)), bytes_of_rays()};
  ForBalancedBands(of_image, threads_, [&](int first, int last) {
    std::fill(photograph + Index(first) * width, photograph + Index(last) * width, Real{0});
    for (int l = 0; l < image_.v_count; ++l) AddViews(l, first, last, rays, photograph);
    for (int y = first; y < last; ++y) {
      Real* row = photograph + Index(y) * width;
      Normalise(y, row, row);
    }
  });
}

template <typename Real>
void GridPhotograph<Real>::AddToView(int view, int first, int last, const Real* framed,
                                     Real* rays) const {
  const int k = view % image_.u_count, l = view / image_.u_count;
  const int s_shift = image_.s_shift[Index(k)], t_shift = image_.t_shift[Index(l)];
  const LandingRect inside = LandingIn(image_, k, l);
  const int begin = std::max(first, inside.y_begin - t_shift);
  const int end = std::min(last, inside.y_end - t_shift);
  if (begin >= end || inside.x_begin >= inside.x_end) return;
  std::vector<kernels::RayPixel<Real>> pixels;  // pixels of the first ray in a row
  for (const RayTap& in_y : TapsOf(image_.t_fraction[Index(l)])) {
    for (const RayTap& in_x : TapsOf(image_.s_fraction[Index(k)])) {
      const double weight = image_.view_weight[Index(view)] * in_y.share * in_x.share;
      if (!(weight > 0)) continue;
      const std::size_t row = Index(begin + t_shift - in_y.offset + 1);
      pixels.push_back({static_cast<Real>(weight),
                        framed + row * framed_width() + Index(inside.x_begin - in_x.offset + 1)});
    }
  }
  if (pixels.empty()) return;
  for (int t = begin; t < end; ++t) {
    const std::size_t sample = Index(t) * Index(image_.s_count) + Index(inside.x_begin - s_shift);
    kernels::AddPixels(
        pixels, irradiance_.empty() ? nullptr : irradiance_[Index(view)].data() + sample,
        Index(inside.x_end - inside.x_begin), rays + Index(view) * view_size() + sample);
    for (kernels::RayPixel<Real>& pixel : pixels) pixel.pixel += framed_width();
  }
}

template <typename Real>
void GridPhotograph<Real>::AddTransposed(const Real* photograph, Real* rays) const {
  // The frame is black, so that rays at the border need no loop of their own.
  std::vector<Real> framed(framed_width() * Index(image_.height_px + 2));
  const Rows of_image{image_.height_px, kMaxBandRows, framed.size() * sizeof(Real)};
  ForBalancedBands(of_image, threads_, [&](int first, int last) {
    for (int y = first; y < last; ++y) {
      Normalise(y, photograph + Index(y) * Index(image_.width_px),
                framed.data() + Index(y + 1) * framed_width() + 1);
    }
  });
  // No two bands share a ray.
  const int t_count = image_.t_count;
  const Rows of_views{image_.views() * t_count, kMaxRayRows, bytes_of_rays()};
  ForBalancedBands(of_views, threads_, [&](int first, int last) {
    for (int view = first / t_count; view * t_count < last; ++view) {
      AddToView(view, std::max(0, first - view * t_count), std::min(t_count, last - view * t_count),
                framed.data(), rays);
    }
  });
}

template <typename Real>
double GridPhotograph<Real>::bytes() const {
  // The framed copy for the transpose.
  double sum = static_cast<double>(framed_width() * Index(image_.height_px + 2) * sizeof(Real));
  for (const auto& view : irradiance_) {
    sum += static_cast<double>(view.capacity() * sizeof(float));
  }
  return sum;
}

template class GridPhotograph<float>;
template class GridPhotograph<double>;

}  // namespace thicklens::estimator
