#ifndef THICKLENS_KERNELS_OPENCL_PACKED_MAP_H_
#define THICKLENS_KERNELS_OPENCL_PACKED_MAP_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "thicklens/kernels/picture_filter.h"

namespace thicklens::kernels {

// The numbers of picture_filter.h as kernels read them: whatever runs side by side reads what lies
// side by side.

// Planes with rows of stride_px numbers, those beyond the width 0.
struct PackedPlane {
  int width_px = 0, height_px = 0;
  int stride_px = 0;

  std::size_t size() const {
    return static_cast<std::size_t>(stride_px) * static_cast<std::size_t>(height_px);
  }
};
// The stride is an odd number of tiles: rows that lie a power of two apart would meet in one place
// of a cache.
PackedPlane PackedPlaneOf(int width_px, int height_px, int tile_px);

// A filter, or its transposed as a filter of its own:
//   y(p) = sum_k c_k(p) x(p + (first + k) e),
// the terms of each tile from the first to the last that is not 0 in all its pixels.
template <typename Real>
struct PackedFilter {
  std::vector<std::int32_t> first;  // of each tile of a plane
  std::vector<std::int32_t> start;  // of its terms; one more than there are tiles
  std::vector<Real> coefficients;   // of a term: one for each pixel of the tile
  int reach_px = 0;                 // the largest |first + k|
};
// left_out: pixels of the filter's result to which it is to give 0.
template <typename Real>
PackedFilter<Real> Pack(const PixelFilter<Real>& filter, bool transposed,
                        const std::vector<std::int32_t>& left_out, const PackedPlane& plane,
                        int tile_px, int threads);

// Rows in slices of `slice`, which have as many entries as the longest of them has; what a shorter
// one lacks has the weight 0. Slices after each other; in a slice the first entries of all rows,
// then the second. Rows are sorted by their length within windows, so that slices lack little.
template <typename Real>
struct PackedRows {
  std::vector<std::int32_t> order;  // which of the rows each one is
  std::vector<std::int32_t> pixel;  // on the packed plane
  std::vector<std::int64_t> start;  // of each slice; one more than there are slices
  std::vector<std::int32_t> index;  // as place_of says
  std::vector<Real> weight;
};
// place_of: what an index of the rows becomes.
template <typename Real>
PackedRows<Real> Pack(const PixelRows<Real>& rows, const std::vector<std::int32_t>& place_of,
                      const PackedPlane& plane, int slice, int threads);

// Of each pixel of the picture, its place on the packed plane.
std::vector<std::int32_t> PackedPlaces(const PackedPlane& plane);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_PACKED_MAP_H_
