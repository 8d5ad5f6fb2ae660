// The rows of H of the pixels whose bundle of rays is no product of its axes.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "estimator/projection/angular_bundle.h"
#include "estimator/views/surface_taps.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

template <typename Real>
struct Band {
  std::vector<std::int32_t> pixel, runs;  // pixel of each row, and its number of runs
  std::vector<std::int32_t> index;        // index of each run
  std::vector<Real> weight;
};

// Sums the weights that fall on the same pixel.
template <typename Real>
class Gatherer {
 public:
  // Rows of the image are stride_px apart.
  Gatherer(int stride_px, int height_px)
      : sum_(Index(stride_px) * Index(height_px), Real{0}), stride_(Index(stride_px)) {}

  void Add(int row, int column, Real weight) {
    sum_[PlaceOf(row, column)] += weight;
    Reach(row, column, 1);
  }

  // Adds to the pixel (row, column), the one at its right, and the two below.
  void AddFour(int row, int column, Real upper, Real upper_right, Real lower, Real lower_right) {
    Real* const at = sum_.data() + PlaceOf(row, column);
    at[0] += upper;
    at[1] += upper_right;
    at[stride_] += lower;
    at[stride_ + 1] += lower_right;
    Reach(row, column, 2);
  }

  // Moves all sums to the end of a band, as the runs of one row.
  void MoveTo(Band<Real>* band) {
    const std::size_t before = band->index.size();
    for (int row = reached_.first_row; row < reached_.end_row; ++row) MoveRuns(row, band);
    band->runs.push_back(static_cast<std::int32_t>(band->index.size() - before));
    reached_ = {};
  }

 private:
  // The part of the image where sums may be.
  struct Part {
    int first_row = std::numeric_limits<int>::max(), end_row = 0;
    int first_column = std::numeric_limits<int>::max(), end_column = 0;
  };

  std::size_t PlaceOf(int row, int column) const { return Index(row) * stride_ + Index(column); }

  void Reach(int row, int column, int count) {
    reached_.first_row = std::min(reached_.first_row, row);
    reached_.end_row = std::max(reached_.end_row, row + count);
    reached_.first_column = std::min(reached_.first_column, column);
    reached_.end_column = std::max(reached_.end_column, column + count);
  }

  // Moved sums become 0, so that runs may extend beyond the sums.
  void MoveRuns(int row, Band<Real>* band) {
    constexpr std::size_t kPixels = kernels::kPixelsOfRun;
    const std::size_t end = PlaceOf(row, reached_.end_column);
    for (std::size_t at = PlaceOf(row, reached_.first_column); at < end; ++at) {
      if (sum_[at] == 0) continue;
      const auto first = sum_.begin() + static_cast<std::ptrdiff_t>(at);
      const auto last = first + static_cast<std::ptrdiff_t>(kPixels);
      band->index.push_back(static_cast<std::int32_t>(at));
      band->weight.insert(band->weight.end(), first, last);
      std::fill(first, last, Real{0});
      at += kPixels - 1;
    }
  }

  std::vector<Real> sum_;  // sum of each pixel of the image
  std::size_t stride_;
  Part reached_;
};

int Floor(float x) {
  const int toward_zero = static_cast<int>(x);
  return toward_zero - (static_cast<float>(toward_zero) > x ? 1 : 0);
}

// Finds the samples of a list by their indices, which must be requested in ascending order from
// `first` on.
template <typename Sample>
class Cursor {
 public:
  Cursor(const std::vector<Sample>& samples, std::size_t first)
      : next_(std::lower_bound(
            samples.data(), samples.data() + samples.size(), first,
            [](const Sample& sample, std::size_t at) { return Index(sample.index) < at; })),
        end_(samples.data() + samples.size()) {}

  // Returns null if there is none.
  const Sample* At(std::size_t i) {
    while (next_ != end_ && Index(next_->index) < i) ++next_;
    return next_ != end_ && Index(next_->index) == i ? next_ : nullptr;
  }

 private:
  const Sample* next_;
  const Sample* end_;
};

// A ray of the pixel (x, y).
struct BundleRay {
  float source_x = 0, source_y = 0, disparity = 0;
  double weight = 0;
};

// Adds the ray's taps, as TapsAt returns them.
template <typename Real>
void AddTaps(const DisparityMap& map, double tolerance, int x, int y, const BundleRay& ray,
             Gatherer<Real>* gatherer) {
  const SurfaceTaps taps = TapsAt(map, tolerance, x + static_cast<double>(ray.source_x),
                                  y + static_cast<double>(ray.source_y), ray.disparity);
  for (std::size_t t = 0; t < Index(taps.count); ++t) {
    const auto width = Index(map.width_px);
    gatherer->Add(static_cast<int>(taps.pixel[t] / width), static_cast<int>(taps.pixel[t] % width),
                  static_cast<Real>(ray.weight * taps.weight[t]));
  }
}

// Adds the taps of the most frequent rays, which read four pixels of one surface. Returns false for
// the other rays. `limit_px` must exceed the width and the height of the image.
template <typename Real>
bool AddFourTaps(const DisparityMap& map, float tolerance, float limit_px, int x, int y,
                 const BundleRay& ray, Gatherer<Real>* gatherer) {
  if (!(std::abs(ray.source_x) < limit_px && std::abs(ray.source_y) < limit_px)) return false;
  const int step_x = Floor(ray.source_x), step_y = Floor(ray.source_y);
  const int column = x + step_x, row = y + step_y;
  if (column < 0 || row < 0 || column + 1 >= map.width_px || row + 1 >= map.height_px) return false;
  const float* const upper = map.disparity.data() + Index(row) * Index(map.width_px) + column;
  const float* const lower = upper + map.width_px;
  const auto is_near = [&](float there) { return std::abs(there - ray.disparity) <= tolerance; };
  if (!is_near(upper[0]) || !is_near(upper[1]) || !is_near(lower[0]) || !is_near(lower[1])) {
    return false;
  }
  const auto weight = static_cast<Real>(ray.weight);
  const auto right = static_cast<Real>(ray.source_x - static_cast<float>(step_x));
  const Real below = weight * static_cast<Real>(ray.source_y - static_cast<float>(step_y));
  const Real above = weight - below;
  gatherer->AddFour(row, column, above - above * right, above * right, below - below * right,
                    below * right);
  return true;
}

// Reserves memory for as many runs in the remaining rows as in the finished ones. Memory that is
// reserved and never written is not used.
template <typename Real>
void Reserve(int rows_done, int rows, Band<Real>* band) {
  if (rows_done == rows) return;
  constexpr double kMore = 1.1;
  const double per_row = kMore * static_cast<double>(band->index.size()) / rows_done;
  const std::size_t needed = band->index.size() + static_cast<std::size_t>(per_row);
  if (band->index.capacity() >= needed) return;
  const auto runs = static_cast<std::size_t>(per_row * rows);
  band->index.reserve(runs);
  band->weight.reserve(runs * Index(kernels::kPixelsOfRun));
}

template <typename Real>
void FillBand(const AngularBundle& bundle, const DisparityMap& map,
              const std::vector<unsigned char>& is_product, int first_row, int last_row,
              Gatherer<Real>* gatherer, Band<Real>* band) {
  const double tolerance = SurfaceTolerance(map);
  const auto near = static_cast<float>(tolerance);
  const auto limit_px = static_cast<float>(map.width_px + map.height_px);
  std::vector<Cursor<CompactView::Occluded>> next_occluded;
  std::vector<Cursor<CompactView::Boundary>> next_boundary;
  for (const BundleView& view : bundle.views) {
    const std::size_t first = Index(first_row) * Index(bundle.width_px);
    next_occluded.emplace_back(view.sees.occluded, first);
    next_boundary.emplace_back(view.sees.boundary, first);
  }
  for (int y = first_row; y < last_row; ++y) {
    for (int x = 0; x < bundle.width_px; ++x) {
      const std::size_t i = Index(y) * Index(bundle.width_px) + Index(x);
      if (is_product[i] != 0) continue;
      ThrowIfCancelled();
      for (std::size_t n = 0; n < bundle.views.size(); ++n) {
        const BundleView& of_fan = bundle.views[n];
        const CompactView& view = of_fan.sees;
        BundleRay ray;
        ray.weight = of_fan.weight;
        ray.disparity = view.disparity[i];
        if (std::isnan(ray.disparity)) {
          const CompactView::Occluded& occluded = *next_occluded[n].At(i);
          ray.source_x = occluded.source_x;
          ray.source_y = occluded.source_y;
          ray.disparity = occluded.disparity;
        } else {
          ray.source_x = static_cast<float>(view.shift.x() * ray.disparity);
          ray.source_y = static_cast<float>(view.shift.y() * ray.disparity);
        }
        if (const CompactView::Boundary* boundary = next_boundary[n].At(i)) {
          const double share = ray.weight * static_cast<double>(boundary->share);
          ray.weight -= share;
          AddTaps(map, tolerance, x, y,
                  {boundary->other.source_x, boundary->other.source_y, boundary->other.disparity,
                   share},
                  gatherer);
        }
        if (!AddFourTaps(map, near, limit_px, x, y, ray, gatherer)) {
          AddTaps(map, tolerance, x, y, ray, gatherer);
        }
      }
      band->pixel.push_back(static_cast<std::int32_t>(i));
      gatherer->MoveTo(band);
    }
    Reserve(y + 1 - first_row, last_row - first_row, band);
  }
}

// Returns the first rows of the parts, and the end. A part has at most so many pixels with a row of
// their own, or one row of the image, and so few rows that all threads have work to the end.
std::vector<int> PartsOf(const AngularBundle& bundle, const std::vector<unsigned char>& is_product,
                         int threads) {
  constexpr int kMaxRows = 32;
  std::vector<std::ptrdiff_t> of_row;
  std::ptrdiff_t all = 0;
  for (int y = 0; y < bundle.height_px; ++y) {
    const auto row = is_product.begin() + std::ptrdiff_t{y} * bundle.width_px;
    of_row.push_back(std::count(row, row + bundle.width_px, 0));
    all += of_row.back();
  }
  const std::ptrdiff_t most = all / (kPartsOfAThread * threads);
  std::vector<int> borders(1, 0);
  std::ptrdiff_t sum = 0;
  for (int y = 0; y < bundle.height_px; ++y) {
    const bool is_full = sum + of_row[Index(y)] > most || y - borders.back() == kMaxRows;
    if (is_full && y > borders.back()) {
      borders.push_back(y);
      sum = 0;
    }
    sum += of_row[Index(y)];
  }
  borders.push_back(bundle.height_px);
  return borders;
}

}  // namespace

template <typename Real>
kernels::PixelBlockedCsr<Real> RunsOf(const AngularBundle& bundle, const DisparityMap& disparity,
                                      const std::vector<unsigned char>& is_product, int threads,
                                      const std::function<void()>& freed) {
  threads = ResolveThreads(threads);
  kernels::PixelBlockedCsr<Real> runs;
  runs.width_px = bundle.width_px;
  runs.height_px = bundle.height_px;
  const std::vector<int> borders = PartsOf(bundle, is_product, threads);
  const int count = static_cast<int>(borders.size()) - 1;
  std::vector<Band<Real>> parts(Index(count));
  // A gatherer has a place for each pixel of the image; each thread therefore has only one.
  std::atomic<int> next{0};
  ParallelFor(std::min(threads, count), threads, [&](int) {
    Gatherer<Real> gatherer(runs.stride_px(), bundle.height_px);
    for (int n = next++; n < count; n = next++) {
      FillBand(bundle, disparity, is_product, borders[Index(n)], borders[Index(n) + 1], &gatherer,
               &parts[Index(n)]);
    }
  });
  std::vector<std::size_t> first(1, 0);  // first run of each part, and the end
  for (const Band<Real>& part : parts) {
    ThrowIfCancelled();
    first.push_back(first.back() + part.index.size());
    runs.pixel.insert(runs.pixel.end(), part.pixel.begin(), part.pixel.end());
  }
  runs.run.push_back(0);
  for (const Band<Real>& part : parts) {
    for (const std::int32_t of_row : part.runs) runs.run.push_back(runs.run.back() + of_row);
  }
  runs.index.resize(first.back());
  runs.weight.resize(first.back() * Index(kernels::kPixelsOfRun));
  ParallelFor(count, threads, [&](int n) {
    Band<Real>& part = parts[Index(n)];
    const std::size_t at = first[Index(n)];
    std::copy(part.index.begin(), part.index.end(),
              runs.index.begin() + static_cast<std::ptrdiff_t>(at));
    std::copy(part.weight.begin(), part.weight.end(),
              runs.weight.data() + at * Index(kernels::kPixelsOfRun));
    part = {};
    if (freed) freed();
  });
  kernels::SetBands(&runs);
  return runs;
}

template kernels::PixelBlockedCsr<float> RunsOf(const AngularBundle&, const DisparityMap&,
                                                const std::vector<unsigned char>&, int,
                                                const std::function<void()>&);
template kernels::PixelBlockedCsr<double> RunsOf(const AngularBundle&, const DisparityMap&,
                                                 const std::vector<unsigned char>&, int,
                                                 const std::function<void()>&);

}  // namespace thicklens::estimator
