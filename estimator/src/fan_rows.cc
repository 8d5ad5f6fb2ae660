// The rows of H of the pixels whose fan of rays is no product of its axes.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "surface_taps.h"
#include "thicklens/model/parallel.h"
#include "view_fan.h"

namespace thicklens::estimator {
namespace {

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

template <typename Real>
struct Band {
  std::vector<std::int32_t> pixel, runs;  // of each row, and how many runs it has
  std::vector<std::int32_t> index;        // of each run
  std::vector<Real> weight;
};

// Sums what falls on the same pixel.
template <typename Real>
class Gatherer {
 public:
  // Rows of the picture lie stride_px apart.
  Gatherer(int stride_px, int height_px)
      : sum_(Index(stride_px) * Index(height_px), Real{0}),
        stride_(Index(stride_px)),
        extent_(Index(height_px)),
        first_row_(height_px) {}

  void Add(int row, int column, Real weight) {
    const std::size_t at = PlaceOf(row, column);
    sum_[at] += weight;
    Extend(row, at, at + 1);
  }

  // To the pixel and the one at its right.
  void Add(int row, int column, Real weight, Real weight_right) {
    const std::size_t at = PlaceOf(row, column);
    sum_[at] += weight;
    sum_[at + 1] += weight_right;
    Extend(row, at, at + 2);
  }

  // All sums to the end of a band, as the runs of one row.
  void MoveTo(Band<Real>* band) {
    const std::size_t before = band->index.size();
    for (int row = first_row_; row <= last_row_; ++row) {
      MoveRuns(extent_[Index(row)], band);
      extent_[Index(row)] = {};
    }
    band->runs.push_back(static_cast<std::int32_t>(band->index.size() - before));
    first_row_ = static_cast<int>(extent_.size());
    last_row_ = -1;
  }

 private:
  // The places of a row of the picture that have a sum lie in [first, end).
  struct Extent {
    std::size_t first = std::numeric_limits<std::size_t>::max(), end = 0;
  };

  std::size_t PlaceOf(int row, int column) const { return Index(row) * stride_ + Index(column); }

  void Extend(int row, std::size_t first, std::size_t end) {
    Extent& extent = extent_[Index(row)];
    extent.first = std::min(extent.first, first);
    extent.end = std::max(extent.end, end);
    first_row_ = std::min(first_row_, row);
    last_row_ = std::max(last_row_, row);
  }

  // What is moved is 0 afterwards, so that runs need not end with the extent.
  void MoveRuns(const Extent& extent, Band<Real>* band) {
    constexpr std::size_t kPixels = kernels::kPixelsOfRun;
    for (std::size_t at = extent.first; at < extent.end; ++at) {
      if (sum_[at] == 0) continue;
      const auto first = sum_.begin() + static_cast<std::ptrdiff_t>(at);
      const auto last = first + static_cast<std::ptrdiff_t>(kPixels);
      band->index.push_back(static_cast<std::int32_t>(at));
      band->weight.insert(band->weight.end(), first, last);
      std::fill(first, last, Real{0});
      at += kPixels - 1;
    }
  }

  std::vector<Real> sum_;  // of each pixel of the picture
  std::size_t stride_;
  std::vector<Extent> extent_;
  int first_row_ = 0, last_row_ = -1;
};

const CompactView::Hidden& HiddenAt(const CompactView& view, std::size_t i) {
  return *std::lower_bound(
      view.hidden.begin(), view.hidden.end(), i,
      [](const CompactView::Hidden& h, std::size_t at) { return Index(h.index) < at; });
}

// The taps of the ray with this source, as TapsAt has them.
template <typename Real>
void AddTaps(const DisparityMap& map, double tolerance, double x, double y, float disparity,
             double weight, Gatherer<Real>* gatherer) {
  const double inside_y = std::clamp(y, 0.0, map.height_px - 1.0);
  const int row = static_cast<int>(inside_y);
  const std::size_t below = Index(row + 1) * Index(map.width_px);
  // Most rays read four pixels of one surface.
  if (x >= 0 && x < map.width_px - 1 && y >= 0 && y < map.height_px - 1) {
    const int column = static_cast<int>(x);
    const std::size_t under = below + Index(column);
    const std::size_t pixel = under - Index(map.width_px);
    const auto is_near = [&](std::size_t p) {
      return std::abs(static_cast<double>(map.disparity[p]) - disparity) <= tolerance;
    };
    if (is_near(pixel) && is_near(pixel + 1) && is_near(under) && is_near(under + 1)) {
      const double right = x - column;
      const double lower = weight * (y - row), upper = weight - lower;
      gatherer->Add(row, column, static_cast<Real>(upper - upper * right),
                    static_cast<Real>(upper * right));
      gatherer->Add(row + 1, column, static_cast<Real>(lower - lower * right),
                    static_cast<Real>(lower * right));
      return;
    }
  }
  const SurfaceTaps taps = TapsAt(map, tolerance, x, y, disparity);
  for (std::size_t t = 0; t < Index(taps.count); ++t) {
    const bool is_below = taps.pixel[t] >= below;
    const std::size_t first = is_below ? below : below - Index(map.width_px);
    gatherer->Add(is_below ? row + 1 : row, static_cast<int>(taps.pixel[t] - first),
                  static_cast<Real>(weight * taps.weight[t]));
  }
}

template <typename Real>
void FillBand(const ViewFan& fan, const DisparityMap& map,
              const std::vector<unsigned char>& is_product, int stride_px, int first_row,
              int last_row, Band<Real>* band) {
  const double tolerance = SurfaceTolerance(map);
  Gatherer<Real> gatherer(stride_px, map.height_px);
  for (int y = first_row; y < last_row; ++y) {
    for (int x = 0; x < fan.width_px; ++x) {
      const std::size_t i = Index(y) * Index(fan.width_px) + Index(x);
      if (is_product[i] != 0) continue;
      for (const FanView& of_fan : fan.views) {
        const CompactView& view = of_fan.sees;
        float disparity = view.disparity[i];
        auto source_x = static_cast<float>(view.shift.x() * disparity);
        auto source_y = static_cast<float>(view.shift.y() * disparity);
        if (std::isnan(disparity)) {
          const CompactView::Hidden& hidden = HiddenAt(view, i);
          source_x = hidden.source_x;
          source_y = hidden.source_y;
          disparity = hidden.disparity;
        }
        AddTaps(map, tolerance, x + static_cast<double>(source_x),
                y + static_cast<double>(source_y), disparity, of_fan.weight, &gatherer);
      }
      band->pixel.push_back(static_cast<std::int32_t>(i));
      gatherer.MoveTo(band);
    }
  }
  // All bands are held at once, and half of what they reserved may be empty.
  band->index.shrink_to_fit();
  band->weight.shrink_to_fit();
}

template <typename T>
void Append(std::vector<T>* from, std::vector<T>* to) {
  to->insert(to->end(), from->begin(), from->end());
  *from = {};
}

}  // namespace

template <typename Real>
kernels::PixelRuns<Real> RunsOf(const ViewFan& fan, const DisparityMap& disparity,
                                const std::vector<unsigned char>& is_product, int threads) {
  kernels::PixelRuns<Real> runs;
  runs.width_px = fan.width_px;
  runs.height_px = fan.height_px;
  constexpr int kBandRows = 32;
  const int bands = (fan.height_px + kBandRows - 1) / kBandRows;
  std::vector<Band<Real>> parts(Index(bands));
  model::ParallelFor(bands, threads, [&](int n) {
    FillBand(fan, disparity, is_product, runs.stride_px(), n * kBandRows,
             std::min((n + 1) * kBandRows, fan.height_px), &parts[Index(n)]);
  });
  std::size_t weights = 0, count = 0, rows = 0;
  for (const Band<Real>& part : parts) {
    weights += part.weight.size();
    count += part.index.size();
    rows += part.pixel.size();
  }
  runs.weight.reserve(weights);
  runs.index.reserve(count);
  runs.pixel.reserve(rows);
  runs.run.reserve(rows + 1);
  runs.run.push_back(0);
  for (Band<Real>& part : parts) {
    for (const std::int32_t of_row : part.runs) runs.run.push_back(runs.run.back() + of_row);
    Append(&part.pixel, &runs.pixel);
    Append(&part.index, &runs.index);
    Append(&part.weight, &runs.weight);
    part = {};
  }
  kernels::SetBands(&runs);
  return runs;
}

template kernels::PixelRuns<float> RunsOf(const ViewFan&, const DisparityMap&,
                                          const std::vector<unsigned char>&, int);
template kernels::PixelRuns<double> RunsOf(const ViewFan&, const DisparityMap&,
                                           const std::vector<unsigned char>&, int);

}  // namespace thicklens::estimator
