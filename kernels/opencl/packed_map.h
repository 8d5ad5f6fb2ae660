#ifndef THICKLENS_KERNELS_OPENCL_PACKED_MAP_H_
#define THICKLENS_KERNELS_OPENCL_PACKED_MAP_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "thicklens/kernels/image_filter.h"

namespace thicklens::kernels {

// The numbers of image_filter.h in the layout of kernels: items that run side by side read
// adjacent numbers.

// Planes with rows of stride_px numbers; those beyond the width are 0.
struct PackedPlane {
  int width_px = 0, height_px = 0;
  int stride_px = 0;

  std::size_t size() const {
    return static_cast<std::size_t>(stride_px) * static_cast<std::size_t>(height_px);
  }
};
// Returns a plane whose stride is an odd number of tiles; rows at a distance of a power of two
// would share one place of a cache.
PackedPlane PackedPlaneOf(int width_px, int height_px, int tile_px);

// A filter, or its transpose as a filter:
//   y(p) = sum_k c_k(p) x(p + (first + k) e).
// The terms of each tile are those from the first to the last that is not 0 in all its pixels.
template <typename Real>
struct PackedFilter {
  std::vector<std::int32_t> first;  // of each tile of a plane
  std::vector<std::int32_t> start;  // first term of each tile; one more than there are tiles
  std::vector<Real> coefficients;   // for each term one number per pixel of the tile
  int reach_px = 0;                 // maximum of |first + k|
};
// `left_out`: pixels of the untransposed filter's result that are set to 0.
template <typename Real>
PackedFilter<Real> Pack(const VaryingFilter<Real>& filter, bool transposed,
                        const std::vector<std::int32_t>& left_out, const PackedPlane& plane,
                        int tile_px, int threads);

// Rows in slices of `slice`. Each slice has as many entries per row as its longest row; missing
// entries have the weight 0. The slices follow each other; a slice has first the first entries of
// all rows, then the second, and so on. Rows are sorted by their length within windows, so that few
// entries are missing.
template <typename Real>
struct PackedRows {
  std::vector<std::int32_t> order;  // original index of each row
  std::vector<std::int32_t> pixel;  // place on the packed plane
  std::vector<std::int64_t> start;  // start of each slice; one more than there are slices
  std::vector<std::int32_t> index;  // converted by place_of
  std::vector<Real> weight;
};
// `place_of` maps the indices of the rows to packed indices.
template <typename Real>
PackedRows<Real> Pack(const PixelCsr<Real>& rows, const std::vector<std::int32_t>& place_of,
                      const PackedPlane& plane, int slice, int threads);

// Returns the place on the packed plane of each pixel of the image.
std::vector<std::int32_t> PackedPlaces(const PackedPlane& plane);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_OPENCL_PACKED_MAP_H_
