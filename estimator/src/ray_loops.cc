#include "ray_loops.h"

namespace thicklens::estimator {
namespace {

typedef std::int32_t LaneNumbers __attribute__((vector_size(kLanes * sizeof(std::int32_t))));

inline __attribute__((always_inline)) void AddTo(const Lanes& more, float* to) {
  Lanes sum;
  Load(to, &sum);
  Store(sum + more, to);
}

inline __attribute__((always_inline)) void Warp(const RayRow& rays, const float* row,
                                                float* warped) {
  for (const RayRun* run = rays.first; run != rays.last; ++run) {
    const float* upper = row + run->step_y * rays.width_px + run->x + run->step_x;
    const float* lower = upper + rays.width_px;
    const float* disparity = rays.disparity + run->x;
    const auto step_x = static_cast<float>(run->step_x);
    const auto step_y = static_cast<float>(run->step_y);
    for (std::int32_t i = 0; i < run->count; i += static_cast<std::int32_t>(kLanes)) {
      Lanes d, left, right, below_left, below_right;
      Load(disparity + i, &d);
      Load(upper + i, &left);
      Load(upper + i + 1, &right);
      Load(lower + i, &below_left);
      Load(lower + i + 1, &below_right);
      const Lanes x = rays.shift_x * d - step_x, y = rays.shift_y * d - step_y;
      left += x * (right - left);
      below_left += x * (below_right - below_left);
      left += y * (below_left - left);
      Store(left, warped + run->x + i);
    }
  }
}

// What the rays of one vector add to the pixels at the right of their cells goes one lane further,
// into the next vector from the last lane.
struct Carry {
  Lanes upper{}, lower{};
};

inline __attribute__((always_inline)) void SpreadLanes(const Lanes& d, const Lanes& value,
                                                       const RayRow& rays, float step_x,
                                                       float step_y, Carry* carry, float* upper,
                                                       float* lower) {
  const Lanes x = rays.shift_x * d - step_x, y = rays.shift_y * d - step_y;
  const Lanes below = y * value, above = value - below;
  const Lanes right = x * above, below_right = x * below;
  AddTo((above - right) + __builtin_shufflevector(carry->upper, right, 7, 8, 9, 10, 11, 12, 13, 14),
        upper);
  AddTo((below - below_right) +
            __builtin_shufflevector(carry->lower, below_right, 7, 8, 9, 10, 11, 12, 13, 14),
        lower);
  carry->upper = right;
  carry->lower = below_right;
}

inline __attribute__((always_inline)) void Spread(const RayRow& rays, const float* values,
                                                  float* row) {
  constexpr auto kStep = static_cast<std::int32_t>(kLanes);
  for (const RayRun* run = rays.first; run != rays.last; ++run) {
    float* upper = row + run->step_y * rays.width_px + run->x + run->step_x;
    float* lower = upper + rays.width_px;
    const float* disparity = rays.disparity + run->x;
    const auto step_x = static_cast<float>(run->step_x);
    const auto step_y = static_cast<float>(run->step_y);
    Carry carry;
    Lanes d, value;
    std::int32_t i = 0;
    for (; i + kStep <= run->count; i += kStep) {
      Load(disparity + i, &d);
      Load(values + run->x + i, &value);
      SpreadLanes(d, value, rays, step_x, step_y, &carry, upper + i, lower + i);
    }
    if (i < run->count) {
      Load(disparity + i, &d);
      Load(values + run->x + i, &value);
      const LaneNumbers lane = {0, 1, 2, 3, 4, 5, 6, 7};
      value = lane < run->count - i ? value : Lanes{};
      SpreadLanes(d, value, rays, step_x, step_y, &carry, upper + i, lower + i);
    } else {
      upper[i] += carry.upper[kLanes - 1];
      lower[i] += carry.lower[kLanes - 1];
    }
  }
}

#if defined(__x86_64__)

bool HasAvx2() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }

__attribute__((target("avx2,fma"))) void WarpAvx2(const RayRow& rays, const float* row,
                                                  float* warped) {
  Warp(rays, row, warped);
}

__attribute__((target("avx2,fma"))) void SpreadAvx2(const RayRow& rays, const float* values,
                                                    float* row) {
  Spread(rays, values, row);
}

#endif

}  // namespace

void WarpRow(const RayRow& rays, const float* row, float* warped) {
#if defined(__x86_64__)
  if (HasAvx2()) return WarpAvx2(rays, row, warped);
#endif
  Warp(rays, row, warped);
}

void SpreadRow(const RayRow& rays, const float* values, float* row) {
#if defined(__x86_64__)
  if (HasAvx2()) return SpreadAvx2(rays, values, row);
#endif
  Spread(rays, values, row);
}

}  // namespace thicklens::estimator
