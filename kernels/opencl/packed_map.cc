#include "kernels/opencl/packed_map.h"

#include <algorithm>
#include <cstdlib>
#include <numeric>

#include "kernels/cpu/bands.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"

namespace thicklens::kernels {
namespace {

constexpr int kWindowSlices = 16;  // number of slices in a window over which rows are sorted

// The coefficients of a filter at any position.
template <typename Real>
class Coefficients {
 public:
  Coefficients(const VaryingFilter<Real>& filter, const std::vector<std::int32_t>& left_out)
      : filter_(filter), is_left_out_(Index(filter.width_px) * Index(filter.height_px), 0) {
    for (const std::int32_t pixel : left_out) is_left_out_[Index(pixel)] = 1;
    for (const std::int32_t radius : filter.radius_px) most_ = std::max(most_, radius);
  }

  int most_radius() const { return most_; }

  // Copies c_n of `count` pixels of row y from x on, with 0 where there is none. Returns true if
  // any is not 0.
  bool Copy(int n, int x, int y, int count, Real* out) const {
    std::fill(out, out + count, Real{0});
    if (y < 0 || y >= filter_.height_px) return false;
    const int end = std::min(x + count, filter_.width_px);
    bool any = false;
    for (int i = std::max(x, 0); i < end;) {
      const int column = i / kFilterBlockPx;
      const int block_end = std::min(end, (column + 1) * kFilterBlockPx);
      const std::size_t block = Index(y) * Index(filter_.blocks_in_row()) + Index(column);
      const int radius = filter_.radius_px[block];
      if (std::abs(n) <= radius) {
        const Real* c = filter_.coefficients.data() + filter_.start[block] +
                        Index(n + radius) * kFilterBlockPx - Index(column * kFilterBlockPx);
        const unsigned char* is_left_out = is_left_out_.data() + Index(y) * Index(filter_.width_px);
        for (int j = i; j < block_end; ++j) {
          if (is_left_out[j] != 0) continue;
          out[j - x] = c[j];
          any = any || c[j] != 0;
        }
      }
      i = block_end;
    }
    return any;
  }

  // Copies the weights with which pixels from x on read the pixels n away: their own c_n, or for
  // the transposed filter c_-n of the pixels that they read.
  bool CopyTerm(bool transposed, int n, int x, int y, int count, Real* out) const {
    if (!transposed) return Copy(n, x, y, count, out);
    return filter_.axis == Axis::kAcross ? Copy(-n, x + n, y, count, out)
                                         : Copy(-n, x, y + n, count, out);
  }

 private:
  const VaryingFilter<Real>& filter_;
  std::vector<unsigned char> is_left_out_;
  int most_ = 0;
};

}  // namespace

PackedPlane PackedPlaneOf(int width_px, int height_px, int tile_px) {
  const int tiles = (width_px + tile_px - 1) / tile_px;
  return {width_px, height_px, (tiles | 1) * tile_px};
}

std::vector<std::int32_t> PackedPlaces(const PackedPlane& plane) {
  std::vector<std::int32_t> places;
  places.reserve(Index(plane.width_px) * Index(plane.height_px));
  for (int y = 0; y < plane.height_px; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < plane.width_px; ++x) places.push_back(y * plane.stride_px + x);
  }
  return places;
}

template <typename Real>
PackedFilter<Real> Pack(const VaryingFilter<Real>& filter, bool transposed,
                        const std::vector<std::int32_t>& left_out, const PackedPlane& plane,
                        int tile_px, int threads) {
  const Coefficients<Real> coefficients(filter, left_out);
  const int most = coefficients.most_radius();
  const int tiles_in_row = plane.stride_px / tile_px;
  const std::size_t tiles = Index(tiles_in_row) * Index(plane.height_px);
  PackedFilter<Real> packed;
  packed.first.resize(tiles);
  packed.start.resize(tiles + 1, 0);
  const int bands = BandCount(plane.height_px, threads, 1);
  std::vector<std::vector<Real>> rooms(Index(bands), std::vector<Real>(Index(tile_px)));
  // First the number of terms of each tile is computed, then their starts, then the terms
  // themselves.
  ForBands(plane.height_px, bands, [&](int band, int first_row, int last_row) {
    for (int y = first_row; y < last_row; ++y) {
      for (int column = 0; column < tiles_in_row; ++column) {
        const std::size_t tile = Index(y) * Index(tiles_in_row) + Index(column);
        const auto is_used = [&](int n) {
          return coefficients.CopyTerm(transposed, n, column * tile_px, y, tile_px,
                                       rooms[Index(band)].data());
        };
        int first = -most;
        int last = most;
        while (first <= last && !is_used(first)) ++first;
        while (last > first && !is_used(last)) --last;
        packed.first[tile] = first <= last ? first : 0;
        packed.start[tile + 1] = last - first + 1;
      }
    }
  });
  for (std::size_t tile = 0; tile < tiles; ++tile) {
    const std::int32_t terms = packed.start[tile + 1];
    const std::int32_t last = packed.first[tile] + terms - 1;
    if (terms > 0) {
      packed.reach_px = std::max({packed.reach_px, std::abs(packed.first[tile]), std::abs(last)});
    }
    packed.start[tile + 1] = packed.start[tile] + terms;
  }
  packed.coefficients.resize(Index(packed.start[tiles]) * Index(tile_px));
  ForBands(plane.height_px, bands, [&](int, int first_row, int last_row) {
    for (int y = first_row; y < last_row; ++y) {
      for (int column = 0; column < tiles_in_row; ++column) {
        const std::size_t tile = Index(y) * Index(tiles_in_row) + Index(column);
        for (std::int32_t term = packed.start[tile]; term < packed.start[tile + 1]; ++term) {
          coefficients.CopyTerm(transposed, packed.first[tile] + term - packed.start[tile],
                                column * tile_px, y, tile_px,
                                packed.coefficients.data() + Index(term) * Index(tile_px));
        }
      }
    }
  });
  return packed;
}

template <typename Real>
PackedRows<Real> Pack(const PixelCsr<Real>& rows, const std::vector<std::int32_t>& place_of,
                      const PackedPlane& plane, int slice, int threads) {
  PackedRows<Real> packed;
  const int count = static_cast<int>(rows.pixel.size());
  const auto length = [&](std::int32_t row) {
    return rows.start[Index(row) + 1] - rows.start[Index(row)];
  };
  packed.order.resize(Index(count));
  std::iota(packed.order.begin(), packed.order.end(), 0);
  const int window = slice > 1 ? slice * kWindowSlices : std::max(count, 1);
  for (int first = 0; slice > 1 && first < count; first += window) {
    std::stable_sort(packed.order.begin() + first,
                     packed.order.begin() + std::min(count, first + window),
                     [&](std::int32_t a, std::int32_t b) { return length(a) > length(b); });
  }
  for (const std::int32_t row : packed.order) {
    const int pixel = rows.pixel[Index(row)];
    packed.pixel.push_back(pixel / plane.width_px * plane.stride_px + pixel % plane.width_px);
  }
  const int slices = (count + slice - 1) / slice;
  packed.start.push_back(0);
  for (int s = 0; s < slices; ++s) {
    std::int64_t most = 0;
    for (int i = s * slice; i < std::min(count, (s + 1) * slice); ++i) {
      most = std::max(most, length(packed.order[Index(i)]));
    }
    packed.start.push_back(packed.start.back() + most * slice);
  }
  packed.index.resize(Index(packed.start.back()), 0);
  packed.weight.resize(Index(packed.start.back()), Real{0});
  ForBands(slices, BandCount(slices, threads, 1), [&](int, int first, int last) {
    for (int i = first * slice; i < std::min(count, last * slice); ++i) {
      const std::size_t row = Index(packed.order[Index(i)]);
      std::size_t to = Index(packed.start[Index(i / slice)] + i % slice);
      for (std::size_t e = Index(rows.start[row]); e < Index(rows.start[row + 1]); ++e) {
        packed.index[to] = place_of[Index(rows.index[e])];
        packed.weight[to] = rows.weight[e];
        to += Index(slice);
      }
    }
  });
  return packed;
}

template PackedFilter<float> Pack(const VaryingFilter<float>&, bool,
                                  const std::vector<std::int32_t>&, const PackedPlane&, int, int);
template PackedFilter<double> Pack(const VaryingFilter<double>&, bool,
                                   const std::vector<std::int32_t>&, const PackedPlane&, int, int);
template PackedRows<float> Pack(const PixelCsr<float>&, const std::vector<std::int32_t>&,
                                const PackedPlane&, int, int);
template PackedRows<double> Pack(const PixelCsr<double>&, const std::vector<std::int32_t>&,
                                 const PackedPlane&, int, int);

}  // namespace thicklens::kernels
