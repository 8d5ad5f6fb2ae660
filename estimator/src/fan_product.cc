// Where a fan of rays is the product of two axes, and the filters of these.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "catmull_rom.h"
#include "product_row.h"
#include "surface_taps.h"
#include "thicklens/model/parallel.h"
#include "view_fan.h"

namespace thicklens::estimator {
namespace {

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

// The lowest and highest disparity of the 2 x 2 pixels from each pixel to the right and down.
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

}  // namespace

std::vector<unsigned char> IsProduct(const ViewFan& fan, const FanAxes& axes,
                                     const DisparityMap& disparity, double tolerance_px,
                                     int threads) {
  const CellRange range(disparity);
  std::vector<unsigned char> is_product(disparity.disparity.size());
  model::ParallelFor(fan.height_px, threads, [&](int y) {
    const std::size_t begin = Index(y) * Index(fan.width_px);
    ProductRow row;
    row.y = y;
    row.width_px = fan.width_px;
    row.height_px = fan.height_px;
    row.tolerance_px = static_cast<float>(tolerance_px);
    row.lowest = range.low.data();
    row.highest = range.high.data();
    row.same_surface = static_cast<float>(SurfaceTolerance(disparity));
    std::vector<std::int32_t> all(Index(fan.width_px), 1);
    for (const FanView& view : fan.views) {
      const auto u = static_cast<std::size_t>(std::lround(view.a + (axes.across.count - 1) / 2.0));
      const auto v = static_cast<std::size_t>(std::lround(view.b + (axes.down.count - 1) / 2.0));
      row.disparity = view.disparity.data() + begin;
      row.shift_x = static_cast<float>(view.shift.x());
      row.shift_y = static_cast<float>(view.shift.y());
      row.down = axes.down.source_px[v].data() + begin;
      row.across = axes.across.source_px[u].data();
      CheckProducts(row, all.data());
    }
    for (std::size_t x = 0; x < all.size(); ++x)
      is_product[begin + x] = static_cast<unsigned char>(all[x]);
  });
  return is_product;
}

namespace {

// What one ray of a pixel reads along an axis.
struct Taps {
  int offset = 0;  // of the first, from the pixel
  int count = 1;
  std::array<double, 4> weight{1, 0, 0, 0};
};

// `is_near(n)`: pixel n of the line is of the ray's surface.
template <typename IsNear>
Taps TapsOnLine(int pixel, float source_px, int count, Between between, const IsNear& is_near) {
  const double at = std::clamp(pixel + static_cast<double>(source_px), 0.0, count - 1.0);
  const int below = static_cast<int>(at);
  const double fraction = at - below;
  if (fraction == 0) return {below - pixel};
  bool cubic = between == Between::kCubic && below >= 1 && below + 2 < count;
  for (int n = below - 1; cubic && n <= below + 2; ++n) cubic = is_near(n);
  if (cubic) return {below - 1 - pixel, 4, CatmullRomWeights(fraction)};
  return {below - pixel, 2, {1 - fraction, fraction, 0, 0}};
}

}  // namespace

template <typename Real>
kernels::PixelFilter<Real> FilterOf(const FanAxis& axis, kernels::Axis direction,
                                    const DisparityMap& disparity, const Eigen::VectorXd& weights,
                                    Between between, int threads) {
  using kernels::kFilterBlockPx;
  const int width_px = disparity.width_px, height_px = disparity.height_px;
  kernels::PixelFilter<Real> filter;
  filter.axis = direction;
  filter.width_px = width_px;
  filter.height_px = height_px;
  const bool across = direction == kernels::Axis::kAcross;
  const int blocks = filter.blocks_in_row();
  filter.radius_px.assign(Index(blocks) * Index(height_px), 0);
  const auto tolerance = static_cast<float>(SurfaceTolerance(disparity));
  const auto taps_of = [&](int x, int y, int position) {
    const std::size_t i = Index(y) * Index(width_px) + Index(x);
    const float way = axis.source_px[Index(position)][i];
    const float* const line =
        disparity.disparity.data() + (across ? Index(y) * Index(width_px) : Index(x));
    const std::size_t step = across ? 1 : Index(width_px);
    const float here = disparity.disparity[i];
    return TapsOnLine(across ? x : y, way, across ? width_px : height_px, between,
                      [&](int n) { return std::abs(line[Index(n) * step] - here) <= tolerance; });
  };
  const auto for_row = [&](int y, const auto& use) {
    for (int x = 0; x < width_px; ++x) {
      const std::size_t i = Index(y) * Index(width_px) + Index(x);
      if (axis.usable[i] == 0) continue;
      const std::size_t block = Index(y) * Index(blocks) + Index(x / kFilterBlockPx);
      for (int position = 0; position < axis.count; ++position)
        use(block, x, taps_of(x, y, position), weights[position]);
    }
  };
  model::ParallelFor(height_px, threads, [&](int y) {
    for_row(y, [&](std::size_t block, int, const Taps& taps, double) {
      const int reach = std::max(-taps.offset, taps.offset + taps.count - 1);
      filter.radius_px[block] = std::max(filter.radius_px[block], reach);
    });
  });
  filter.start.assign(1, 0);
  for (const int radius : filter.radius_px) {
    filter.start.push_back(filter.start.back() + Index(2 * radius + 1) * kFilterBlockPx);
  }
  filter.coefficients.assign(filter.start.back(), Real(0));
  const double total = weights.sum();
  model::ParallelFor(height_px, threads, [&](int y) {
    const auto coefficient = [&](std::size_t block, int x, int offset) -> Real& {
      return filter.coefficients[filter.start[block] +
                                 Index(offset + filter.radius_px[block]) * kFilterBlockPx +
                                 Index(x % kFilterBlockPx)];
    };
    for_row(y, [&](std::size_t block, int x, const Taps& taps, double weight) {
      for (int n = 0; n < taps.count; ++n)
        coefficient(block, x, taps.offset + n) += static_cast<Real>(weight * taps.weight[Index(n)]);
    });
    for (int x = 0; x < width_px; ++x) {
      if (axis.usable[Index(y) * Index(width_px) + Index(x)] != 0) continue;
      const std::size_t block = Index(y) * Index(blocks) + Index(x / kFilterBlockPx);
      coefficient(block, x, 0) = static_cast<Real>(total);
    }
  });
  return filter;
}

template kernels::PixelFilter<float> FilterOf(const FanAxis&, kernels::Axis, const DisparityMap&,
                                              const Eigen::VectorXd&, Between, int);
template kernels::PixelFilter<double> FilterOf(const FanAxis&, kernels::Axis, const DisparityMap&,
                                               const Eigen::VectorXd&, Between, int);

}  // namespace thicklens::estimator
