#ifndef THICKLENS_ESTIMATOR_CPU_RAY_LOOPS_H_
#define THICKLENS_ESTIMATOR_CPU_RAY_LOOPS_H_

#include <cstddef>
#include <cstdint>

#include "estimator/cpu/lanes.h"

namespace thicklens::estimator {

// The innermost loops over the rays of a view. They take kLanes rays together, of which the last
// may lie beyond the end of a run, a row or a picture.

// Neighbouring rays whose sources lie in neighbouring cells of four pixels.
struct RayRun {
  std::int32_t x = 0, count = 0;        // of the row
  std::int32_t step_x = 0, step_y = 0;  // from a ray's pixel to the first pixel of its cell
};

// The way to the source of the ray x is disparity[x] * (shift_x, shift_y), px.
template <typename Real>
struct RayRow {
  const Real* disparity = nullptr;
  Real shift_x = 0, shift_y = 0;
  const RayRun* first = nullptr;
  const RayRun* last = nullptr;
  std::ptrdiff_t width_px = 0;
};

// warped[x] = what the picture has at the source of ray x, linear between its pixels, for the rays
// in runs. `row`: the same row of that picture. May write kLanes - 1 numbers after each run, and
// read as many after the picture's last.
template <typename Real>
void WarpRow(const RayRow<Real>& rays, const Real* row, Real* warped);
// The transpose: adds to the picture. May read kLanes - 1 numbers after the last value, and touch
// (not change) as many of the picture after its last.
template <typename Real>
void SpreadRow(const RayRow<Real>& rays, const Real* values, Real* row);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_CPU_RAY_LOOPS_H_
