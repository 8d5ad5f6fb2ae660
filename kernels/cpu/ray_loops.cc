#include "thicklens/kernels/ray_loops.h"

#include "kernels/cpu/lanes.h"
#include "kernels/cpu/processor.h"

namespace thicklens::kernels {
namespace {

static_assert(kRaysTogether == kLanes);

template <typename Real>
inline __attribute__((always_inline)) void AddTo(const Lanes<Real>& more, Real* to) {
  Lanes<Real> sum;
  Load(to, &sum);
  Store(sum + more, to);
}

template <typename Real>
inline __attribute__((always_inline)) void Warp(const RayRow<Real>& rays, const Real* row,
                                                Real* warped) {
  for (const RayRun* run = rays.first; run != rays.last; ++run) {
    const Real* upper = row + run->step_y * rays.width_px + run->x + run->step_x;
    const Real* lower = upper + rays.width_px;
    const Real* disparity = rays.disparity + run->x;
    const auto step_x = static_cast<Real>(run->step_x);
    const auto step_y = static_cast<Real>(run->step_y);
    for (std::int32_t i = 0; i < run->count; i += static_cast<std::int32_t>(kLanes)) {
      Lanes<Real> d, left, right, below_left, below_right;
      Load(disparity + i, &d);
      Load(upper + i, &left);
      Load(upper + i + 1, &right);
      Load(lower + i, &below_left);
      Load(lower + i + 1, &below_right);
      const Lanes<Real> x = rays.shift_x * d - step_x, y = rays.shift_y * d - step_y;
      left += x * (right - left);
      below_left += x * (below_right - below_left);
      left += y * (below_left - left);
      Store(left, warped + run->x + i);
    }
  }
}

// Carry between vectors: the pixels at the right of the cells are one lane further, so the last
// lane adds to the next vector.
template <typename Real>
struct Carry {
  Lanes<Real> upper{}, lower{};
};

template <typename Real>
inline __attribute__((always_inline)) void SpreadLanes(const Lanes<Real>& d,
                                                       const Lanes<Real>& value,
                                                       const RayRow<Real>& rays, Real step_x,
                                                       Real step_y, Carry<Real>* carry, Real* upper,
                                                       Real* lower) {
  const Lanes<Real> x = rays.shift_x * d - step_x, y = rays.shift_y * d - step_y;
  const Lanes<Real> below = y * value, above = value - below;
  const Lanes<Real> right = x * above, below_right = x * below;
  AddTo((above - right) + __builtin_shufflevector(carry->upper, right, 7, 8, 9, 10, 11, 12, 13, 14),
        upper);
  AddTo((below - below_right) +
            __builtin_shufflevector(carry->lower, below_right, 7, 8, 9, 10, 11, 12, 13, 14),
        lower);
  carry->upper = right;
  carry->lower = below_right;
}

template <typename Real>
inline __attribute__((always_inline)) void Spread(const RayRow<Real>& rays, const Real* values,
                                                  Real* row) {
  constexpr auto kStep = static_cast<std::int32_t>(kLanes);
  for (const RayRun* run = rays.first; run != rays.last; ++run) {
    Real* upper = row + run->step_y * rays.width_px + run->x + run->step_x;
    Real* lower = upper + rays.width_px;
    const Real* disparity = rays.disparity + run->x;
    const auto step_x = static_cast<Real>(run->step_x);
    const auto step_y = static_cast<Real>(run->step_y);
    Carry<Real> carry;
    Lanes<Real> d, value;
    std::int32_t i = 0;
    for (; i + kStep <= run->count; i += kStep) {
      Load(disparity + i, &d);
      Load(values + run->x + i, &value);
      SpreadLanes(d, value, rays, step_x, step_y, &carry, upper + i, lower + i);
    }
    if (i < run->count) {
      Load(disparity + i, &d);
      Load(values + run->x + i, &value);
      const Lanes<Real> lane = {0, 1, 2, 3, 4, 5, 6, 7};
      value = lane < static_cast<Real>(run->count - i) ? value : Lanes<Real>{};
      SpreadLanes(d, value, rays, step_x, step_y, &carry, upper + i, lower + i);
    } else {
      upper[i] += carry.upper[kLanes - 1];
      lower[i] += carry.lower[kLanes - 1];
    }
  }
}

#if defined(__x86_64__)

template <typename Real>
__attribute__((target("avx2,fma"))) void WarpAvx2(const RayRow<Real>& rays, const Real* row,
                                                  Real* warped) {
  Warp(rays, row, warped);
}

template <typename Real>
__attribute__((target("avx2,fma"))) void SpreadAvx2(const RayRow<Real>& rays, const Real* values,
                                                    Real* row) {
  Spread(rays, values, row);
}

#endif

}  // namespace

template <typename Real>
void WarpRow(const RayRow<Real>& rays, const Real* row, Real* warped) {
#if defined(__x86_64__)
  if (HasAvx2AndFma()) return WarpAvx2(rays, row, warped);
#endif
  Warp(rays, row, warped);
}

template <typename Real>
void SpreadRow(const RayRow<Real>& rays, const Real* values, Real* row) {
#if defined(__x86_64__)
  if (HasAvx2AndFma()) return SpreadAvx2(rays, values, row);
#endif
  Spread(rays, values, row);
}

template void WarpRow(const RayRow<float>&, const float*, float*);
template void WarpRow(const RayRow<double>&, const double*, double*);
template void SpreadRow(const RayRow<float>&, const float*, float*);
template void SpreadRow(const RayRow<double>&, const double*, double*);

}  // namespace thicklens::kernels
