// The rows of H of the pixels whose fan of rays is no product of its axes.
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "surface_taps.h"
#include "thicklens/model/parallel.h"
#include "view_fan.h"

namespace thicklens::estimator {
namespace {

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

// Sums what falls on the same pixel, in the order of the first time.
class Gatherer {
 public:
  explicit Gatherer(std::size_t pixels) : slot_(pixels, -1) {}

  void Add(std::size_t pixel, double weight) {
    if (slot_[pixel] < 0) {
      slot_[pixel] = static_cast<std::int32_t>(pixels_.size());
      pixels_.push_back(static_cast<std::int32_t>(pixel));
      weights_.push_back(0);
    }
    weights_[static_cast<std::size_t>(slot_[pixel])] += weight;
  }

  template <typename Real>
  void MoveTo(std::vector<std::int32_t>* index, std::vector<Real>* weight) {
    for (std::size_t i = 0; i < pixels_.size(); ++i) {
      index->push_back(pixels_[i]);
      weight->push_back(static_cast<Real>(weights_[i]));
      slot_[static_cast<std::size_t>(pixels_[i])] = -1;
    }
    pixels_.clear();
    weights_.clear();
  }

 private:
  std::vector<std::int32_t> slot_;  // of each pixel of the picture, or -1
  std::vector<std::int32_t> pixels_;
  std::vector<double> weights_;
};

template <typename Real>
struct Band {
  std::vector<std::int32_t> pixel, length, index;
  std::vector<Real> weight;
};

const FanView::Hidden& HiddenAt(const FanView& view, std::size_t i) {
  return *std::lower_bound(
      view.hidden.begin(), view.hidden.end(), i,
      [](const FanView::Hidden& h, std::size_t at) { return Index(h.index) < at; });
}

template <typename Real>
void FillBand(const ViewFan& fan, const DisparityMap& map,
              const std::vector<unsigned char>& is_product, int first_row, int last_row,
              Band<Real>* band) {
  const double tolerance = SurfaceTolerance(map);
  Gatherer gatherer(map.disparity.size());
  for (int y = first_row; y < last_row; ++y) {
    for (int x = 0; x < fan.width_px; ++x) {
      const std::size_t i = Index(y) * Index(fan.width_px) + Index(x);
      if (is_product[i] != 0) continue;
      for (const FanView& view : fan.views) {
        float disparity = view.disparity[i];
        auto source_x = static_cast<float>(view.shift.x() * disparity);
        auto source_y = static_cast<float>(view.shift.y() * disparity);
        if (std::isnan(disparity)) {
          const FanView::Hidden& hidden = HiddenAt(view, i);
          source_x = hidden.source_x;
          source_y = hidden.source_y;
          disparity = hidden.disparity;
        }
        const SurfaceTaps taps = TapsAt(map, tolerance, x + static_cast<double>(source_x),
                                        y + static_cast<double>(source_y), disparity);
        for (int t = 0; t < taps.count; ++t)
          gatherer.Add(taps.pixel[Index(t)], view.weight * taps.weight[Index(t)]);
      }
      const std::size_t before = band->index.size();
      gatherer.MoveTo(&band->index, &band->weight);
      band->pixel.push_back(static_cast<std::int32_t>(i));
      band->length.push_back(static_cast<std::int32_t>(band->index.size() - before));
    }
  }
  // All bands are held at once, and half of what they reserved may be empty.
  band->index.shrink_to_fit();
  band->weight.shrink_to_fit();
}

}  // namespace

template <typename Real>
kernels::PixelRows<Real> RowsOf(const ViewFan& fan, const DisparityMap& disparity,
                                const std::vector<unsigned char>& is_product, int threads) {
  constexpr int kBandRows = 32;
  const int bands = (fan.height_px + kBandRows - 1) / kBandRows;
  std::vector<Band<Real>> parts(Index(bands));
  model::ParallelFor(bands, threads, [&](int n) {
    FillBand(fan, disparity, is_product, n * kBandRows,
             std::min((n + 1) * kBandRows, fan.height_px), &parts[Index(n)]);
  });
  kernels::PixelRows<Real> rows;
  rows.pixels = fan.width_px * fan.height_px;
  rows.start.push_back(0);
  std::size_t entries = 0, count = 0;
  for (const Band<Real>& part : parts) {
    entries += part.index.size();
    count += part.pixel.size();
  }
  rows.index.reserve(entries);
  rows.weight.reserve(entries);
  rows.pixel.reserve(count);
  rows.start.reserve(count + 1);
  for (Band<Real>& part : parts) {
    rows.pixel.insert(rows.pixel.end(), part.pixel.begin(), part.pixel.end());
    for (const std::int32_t length : part.length) rows.start.push_back(rows.start.back() + length);
    rows.index.insert(rows.index.end(), part.index.begin(), part.index.end());
    rows.weight.insert(rows.weight.end(), part.weight.begin(), part.weight.end());
    part = {};
  }
  return rows;
}

template kernels::PixelRows<float> RowsOf(const ViewFan&, const DisparityMap&,
                                          const std::vector<unsigned char>&, int);
template kernels::PixelRows<double> RowsOf(const ViewFan&, const DisparityMap&,
                                           const std::vector<unsigned char>&, int);

}  // namespace thicklens::estimator
