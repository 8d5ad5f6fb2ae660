#ifndef THICKLENS_KERNELS_RAY_LOOPS_H_
#define THICKLENS_KERNELS_RAY_LOOPS_H_

#include <cstddef>
#include <cstdint>

#include "thicklens/base/export.h"

namespace thicklens::kernels {

// The innermost loops over the rays of a view. They process kRaysTogether rays together, and the
// last of these may lie beyond the end of a run, a row or an image.
constexpr std::size_t kRaysTogether = 8;

// Neighbouring rays that come from neighbouring cells of four pixels.
struct RayRun {
  std::int32_t x = 0, count = 0;        // of the row
  std::int32_t step_x = 0, step_y = 0;  // from a ray's pixel to the first pixel of its cell
};

// The ray x comes from the point at disparity[x] * (shift_x, shift_y), px, from its pixel.
template <typename Real>
struct RayRow {
  const Real* disparity = nullptr;  // of the rays of the row
  Real shift_x = 0, shift_y = 0;    // px per unit of disparity
  const RayRun* first = nullptr;    // first run of the row
  const RayRun* last = nullptr;     // behind the last run of the row
  std::ptrdiff_t width_px = 0;      // width of the image, px
};

// Sets warped[x] to the value of the image at the point that ray x comes from, linear between the
// pixels, for the rays in runs. `row` is the same row of that image. May write kRaysTogether - 1
// numbers after each run and read as many after the image's last number.
template <typename Real>
THICKLENS_EXPORT void WarpRow(const RayRow<Real>& rays, const Real* row, Real* warped);
// Applies the transpose of WarpRow: adds to the image. May read kRaysTogether - 1 numbers after the
// last value, and touch (not change) as many after the image's last number.
template <typename Real>
THICKLENS_EXPORT void SpreadRow(const RayRow<Real>& rays, const Real* values, Real* row);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_RAY_LOOPS_H_
