#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "kernels/reference/arguments.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/kernels/image_filter.h"

namespace thicklens::kernels {
namespace {

constexpr std::int64_t kMaxPixels = std::numeric_limits<std::int32_t>::max();

// Throws Error unless every pixel of the block reads only pixels inside the image.
template <typename Real>
void CheckBlockAt(const VaryingFilter<Real>& filter, int row, int column, std::size_t block) {
  const bool across = filter.axis == Axis::kAcross;
  const int end = across ? filter.width_px : filter.height_px;
  const std::int64_t radius = filter.radius_px[block];
  std::size_t at = filter.start[block];
  for (std::int64_t n = -radius; n <= radius; ++n) {
    for (int i = 0; i < kFilterBlockPx; ++i, ++at) {
      const Real value = filter.coefficients[at];
      const int x = column * kFilterBlockPx + i;
      const auto place = [&] {
        return fmt::format("filter: coefficients: the coefficient n = {} of pixel ({}, {}) is {}",
                           n, x, row, value);
      };
      if (!std::isfinite(value)) throw Error(place() + ": it must be finite");
      const std::int64_t source = (across ? x : row) + n;
      if ((x >= filter.width_px || source < 0 || source >= end) && value != 0) {
        throw Error(
            fmt::format("{}: it must be 0, because it is outside the image of {} x {} pixels",
                        place(), filter.width_px, filter.height_px));
      }
    }
  }
}

// Checks the number of starts and that the first is 0, and calls check(i) for each interval.
template <typename Start, typename CheckInterval>
void CheckStart(const char* what, const Start& start, std::size_t intervals,
                const CheckInterval& check) {
  CheckSize(what, start.size(), intervals + 1);
  if (start[0] != 0) {
    throw Error(fmt::format("{} begins with {}: it must begin with 0", what, start[0]));
  }
  for (std::size_t i = 0; i < intervals; ++i) check(i);
}

}  // namespace

template <typename Real>
void Check(const VaryingFilter<Real>& filter) {
  if (!(filter.width_px >= 0 && filter.height_px >= 0) ||
      std::int64_t{filter.width_px} * filter.height_px > kMaxPixels) {
    throw Error(
        fmt::format("filter: width_px and height_px are {} and {}: they must be >= 0, and "
                    "their product at most {}",
                    filter.width_px, filter.height_px, kMaxPixels));
  }
  const std::size_t blocks = Index(filter.blocks_in_row()) * Index(filter.height_px);
  CheckSize("filter: radius_px", filter.radius_px.size(), blocks);
  CheckStart("filter: start", filter.start, blocks, [&](std::size_t block) {
    const std::int64_t radius = filter.radius_px[block];
    if (radius < 0) {
      throw Error(
          fmt::format("filter: radius_px of block {} is {}: it must be >= 0", block, radius));
    }
    const std::size_t end = filter.start[block] + Index(2 * radius + 1) * Index(kFilterBlockPx);
    if (filter.start[block + 1] != end) {
      throw Error(
          fmt::format("filter: start of block {} is {}: it must be {}, because the previous block "
                      "has radius {}",
                      block + 1, filter.start[block + 1], end, radius));
    }
  });
  CheckSize("filter: coefficients", filter.coefficients.size(), filter.start.back());
  std::size_t block = 0;
  for (int row = 0; row < filter.height_px; ++row) {
    for (int column = 0; column < filter.blocks_in_row(); ++column) {
      CheckBlockAt(filter, row, column, block++);
    }
  }
}

template <typename Real>
void Check(const PixelCsr<Real>& rows) {
  if (!(rows.pixels >= 0)) {
    throw Error(fmt::format("rows: pixels is {}: it must be >= 0", rows.pixels));
  }
  std::int64_t before = -1;
  for (const std::int32_t pixel : rows.pixel) {
    if (!(pixel > before && pixel < rows.pixels)) {
      throw Error(
          fmt::format("rows: pixel: {} follows {}: the list must ascend from 0 to at most {}",
                      pixel, before, rows.pixels - 1));
    }
    before = pixel;
  }
  CheckStart("rows: start", rows.start, rows.pixel.size(), [&](std::size_t row) {
    if (!(rows.start[row + 1] >= rows.start[row])) {
      throw Error(
          fmt::format("rows: start of row {} is {}: it must be at least the previous start, {}",
                      row + 1, rows.start[row + 1], rows.start[row]));
    }
  });
  CheckSize("rows: index", rows.index.size(), Index(rows.start.back()));
  CheckSize("rows: weight", rows.weight.size(), rows.index.size());
  for (std::size_t e = 0; e < rows.index.size(); ++e) {
    if (!(rows.index[e] >= 0 && rows.index[e] < rows.pixels)) {
      throw Error(fmt::format("rows: index of entry {} is {}: it must be 0 to {}", e, rows.index[e],
                              rows.pixels - 1));
    }
    if (!std::isfinite(rows.weight[e])) {
      throw Error(
          fmt::format("rows: weight of entry {} is {}: it must be finite", e, rows.weight[e]));
    }
  }
}

template void Check(const VaryingFilter<float>&);
template void Check(const VaryingFilter<double>&);
template void Check(const PixelCsr<float>&);
template void Check(const PixelCsr<double>&);

}  // namespace thicklens::kernels
