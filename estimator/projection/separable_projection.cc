// Finds where a bundle of rays is the product of two axes, and makes the filters of these.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "estimator/projection/angular_bundle.h"
#include "estimator/views/surface_taps.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/base/parallel.h"
#include "thicklens/kernels/catmull_rom.h"
#include "thicklens/kernels/product_row.h"

namespace thicklens::estimator {
namespace {

// Minimum and maximum disparity of the 2 x 2 pixels from each pixel to the right and down.
struct CellRange {
  std::vector<float> low, high;
  explicit CellRange(const DisparityMap& map) : low(map.disparity), high(map.disparity) {
    const auto width = Index(map.width_px);
    for (std::size_t i = 0; i < low.size(); ++i) {
      const bool has_right = i % width + 1 < width;
      const bool has_below = i + width < low.size();
      for (const std::size_t next : {has_right ? i + 1 : i, has_below ? i + width : i,
                                     has_right && has_below ? i + width + 1 : i}) {
        low[i] = std::min(low[i], map.disparity[next]);
        high[i] = std::max(high[i], map.disparity[next]);
      }
    }
  }
};

// The range from `first` to before `last`.
struct Stretch {
  int first, last;
};
std::vector<Stretch> StretchesOfZero(const unsigned char* flags, int count) {
  std::vector<Stretch> stretches;
  for (int x = 0; x < count; ++x) {
    if (flags[x] != 0) continue;
    if (stretches.empty() || stretches.back().last != x) stretches.push_back({x, x});
    stretches.back().last = x + 1;
  }
  return stretches;
}

}  // namespace

std::vector<unsigned char> IsProduct(const AngularBundle& bundle, const BundleAxes& axes,
                                     const DisparityMap& disparity, double tolerance_px,
                                     const std::vector<unsigned char>& known, int threads) {
  const CellRange range(disparity);
  std::vector<unsigned char> is_product(disparity.disparity.size());
  ParallelFor(bundle.height_px, threads, [&](int y) {
    const std::size_t begin = Index(y) * Index(bundle.width_px);
    kernels::ProductRow row;
    row.y = y;
    row.width_px = bundle.width_px;
    row.height_px = bundle.height_px;
    row.tolerance_px = static_cast<float>(tolerance_px);
    row.lowest = range.low.data();
    row.highest = range.high.data();
    row.same_surface = static_cast<float>(SurfaceTolerance(disparity));
    std::vector<std::int32_t> all(Index(bundle.width_px), 1);
    const std::vector<Stretch> unknown = StretchesOfZero(known.data() + begin, bundle.width_px);
    for (const BundleView& view : bundle.views) {
      const auto u = static_cast<std::size_t>(std::lround(view.a + (axes.across.count - 1) / 2.0));
      const auto v = static_cast<std::size_t>(std::lround(view.b + (axes.down.count - 1) / 2.0));
      row.disparity = view.sees.disparity.data() + begin;
      row.shift_x = static_cast<float>(view.sees.shift.x());
      row.shift_y = static_cast<float>(view.sees.shift.y());
      row.down = axes.down.source_px[v].data() + begin;
      row.across = axes.across.source_px[u].data();
      for (const Stretch& stretch : unknown) {
        row.first_x = stretch.first;
        row.last_x = stretch.last;
        kernels::CheckProducts(row, all.data());
      }
    }
    for (std::size_t x = 0; x < all.size(); ++x)
      is_product[begin + x] = static_cast<unsigned char>(all[x]);
  });
  return is_product;
}

namespace {

// The pixels that one ray of a pixel reads along an axis.
struct Taps {
  int offset = 0;  // offset of the first tap from the pixel
  int count = 1;
  std::array<double, 4> weight{1, 0, 0, 0};
};

// `is_near(n)`: pixel n of the line is of the ray's surface.
template <typename IsNear>
Taps TapsOnLine(int pixel, float source_px, int count, Interpolation interpolation,
                const IsNear& is_near) {
  const double at = std::clamp(pixel + static_cast<double>(source_px), 0.0, count - 1.0);
  const int below = static_cast<int>(at);
  const double fraction = at - below;
  if (fraction == 0) return {below - pixel};
  bool cubic = interpolation == Interpolation::kCubic && below >= 1 && below + 2 < count;
  for (int n = below - 1; cubic && n <= below + 2; ++n) cubic = is_near(n);
  if (cubic) return {below - 1 - pixel, 4, kernels::CatmullRomWeights<double>(fraction)};
  return {below - pixel, 2, {1 - fraction, fraction, 0, 0}};
}

// The filter of an axis in one row of the image.
template <typename Real>
struct FilterRow {
  std::vector<std::int32_t> radius_px;  // radius of each block
  std::vector<Real> coefficients;       // in the order of a VaryingFilter
};

// Makes rows of a filter from its inputs, with reusable memory.
class FilterMaker {
 public:
  FilterMaker(const BundleAxis& axis, kernels::Axis direction, const DisparityMap& disparity,
              const Eigen::VectorXd& weights, Interpolation interpolation)
      : axis_(axis),
        across_(direction == kernels::Axis::kAcross),
        disparity_(disparity),
        weights_(weights),
        between_(interpolation),
        tolerance_(static_cast<float>(SurfaceTolerance(disparity))),
        taps_(Index(disparity.width_px) * Index(axis.count)) {}

  template <typename Real>
  void Make(int y, FilterRow<Real>* row) {
    FindTaps(y, &row->radius_px);
    std::vector<std::size_t> start(1, 0);
    for (const std::int32_t radius : row->radius_px)
      start.push_back(start.back() + Index(2 * radius + 1) * kernels::kFilterBlockPx);
    row->coefficients.assign(start.back(), Real(0));
    const Taps* taps = taps_.data();
    for (int x = 0; x < disparity_.width_px; ++x, taps += axis_.count) {
      const std::size_t block = Index(x / kernels::kFilterBlockPx);
      Real* const middle = row->coefficients.data() + start[block] +
                           Index(row->radius_px[block]) * kernels::kFilterBlockPx +
                           Index(x % kernels::kFilterBlockPx);
      if (!IsUsable(x, y)) {
        *middle = static_cast<Real>(weights_.sum());
        continue;
      }
      for (int position = 0; position < axis_.count; ++position) {
        const double weight = weights_[position];
        Real* to = middle + std::ptrdiff_t{taps[position].offset} * kernels::kFilterBlockPx;
        for (int n = 0; n < taps[position].count; ++n, to += kernels::kFilterBlockPx)
          *to += static_cast<Real>(weight * taps[position].weight[Index(n)]);
      }
    }
  }

 private:
  bool IsUsable(int x, int y) const {
    return axis_.usable[Index(y) * Index(disparity_.width_px) + Index(x)] != 0;
  }

  void FindTaps(int y, std::vector<std::int32_t>* radius_px) {
    const int width_px = disparity_.width_px;
    radius_px->assign(Index((width_px + kernels::kFilterBlockPx - 1) / kernels::kFilterBlockPx), 0);
    const int count = across_ ? width_px : disparity_.height_px;
    const std::size_t step = across_ ? 1 : Index(width_px);
    const float* const row = disparity_.disparity.data() + Index(y) * Index(width_px);
    Taps* to = taps_.data();
    for (int x = 0; x < width_px; ++x, to += axis_.count) {
      if (!IsUsable(x, y)) continue;
      const float* const line = across_ ? row : disparity_.disparity.data() + x;
      const float here = row[x];
      std::int32_t reach = 0;
      for (int position = 0; position < axis_.count; ++position) {
        const float way = axis_.source_px[Index(position)][Index(y) * Index(width_px) + Index(x)];
        to[position] = TapsOnLine(across_ ? x : y, way, count, between_, [&](int n) {
          return std::abs(line[Index(n) * step] - here) <= tolerance_;
        });
        reach =
            std::max({reach, -to[position].offset, to[position].offset + to[position].count - 1});
      }
      std::int32_t& radius = (*radius_px)[Index(x / kernels::kFilterBlockPx)];
      radius = std::max(radius, reach);
    }
  }

  const BundleAxis& axis_;
  const bool across_;
  const DisparityMap& disparity_;
  const Eigen::VectorXd& weights_;
  const Interpolation between_;
  const float tolerance_;
  std::vector<Taps> taps_;  // taps of a row: of each pixel, of each position
};

}  // namespace

template <typename Real>
kernels::VaryingFilter<Real> FilterOf(const BundleAxis& axis, kernels::Axis direction,
                                      const DisparityMap& disparity, const Eigen::VectorXd& weights,
                                      Interpolation interpolation, int threads) {
  constexpr int kBandRows = 32;
  const int height_px = disparity.height_px;
  kernels::VaryingFilter<Real> filter;
  filter.axis = direction;
  filter.width_px = disparity.width_px;
  filter.height_px = height_px;
  std::vector<FilterRow<Real>> rows(Index(height_px));
  ParallelFor((height_px + kBandRows - 1) / kBandRows, threads, [&](int band) {
    FilterMaker maker(axis, direction, disparity, weights, interpolation);
    const int last = std::min((band + 1) * kBandRows, height_px);
    for (int y = band * kBandRows; y < last; ++y) {
      ThrowIfCancelled();
      maker.Make(y, &rows[Index(y)]);
    }
  });
  filter.start.assign(1, 0);
  for (const FilterRow<Real>& row : rows) {
    filter.radius_px.insert(filter.radius_px.end(), row.radius_px.begin(), row.radius_px.end());
    for (const std::int32_t radius : row.radius_px) {
      filter.start.push_back(filter.start.back() + Index(2 * radius + 1) * kernels::kFilterBlockPx);
    }
  }
  // The rows are appended one by one and freed at once, so that they are never held twice.
  filter.coefficients.reserve(filter.start.back());
  for (FilterRow<Real>& row : rows) {
    ThrowIfCancelled();
    filter.coefficients.insert(filter.coefficients.end(), row.coefficients.begin(),
                               row.coefficients.end());
    row = {};
  }
  return filter;
}

template kernels::VaryingFilter<float> FilterOf(const BundleAxis&, kernels::Axis,
                                                const DisparityMap&, const Eigen::VectorXd&,
                                                Interpolation, int);
template kernels::VaryingFilter<double> FilterOf(const BundleAxis&, kernels::Axis,
                                                 const DisparityMap&, const Eigen::VectorXd&,
                                                 Interpolation, int);

}  // namespace thicklens::estimator
