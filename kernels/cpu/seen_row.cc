#include "thicklens/kernels/seen_row.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "kernels/cpu/processor.h"
#include "thicklens/kernels/cell_disparity.h"

namespace thicklens::kernels {
namespace {

// The code has no branches, for the vector instructions of the caller that it is inlined into. NaN
// fails every comparison.
inline __attribute__((always_inline)) void Add(const VisibleRow& given, float* share) {
  const VisibleRow row = given;
  const auto outer_x = static_cast<float>(row.width_px) - 0.5F;
  const auto outer_y = static_cast<float>(row.height_px) - 0.5F;
  // No two of the arrays overlap.
#pragma GCC ivdep
  for (std::int32_t x = 0; x < row.width_px; ++x) {
    const float disparity = row.points_disparity[x];
    const float at_x = static_cast<float>(x) - row.shift_x * disparity;
    const float at_y = static_cast<float>(row.y) - row.shift_y * disparity;
    // The pixels around the ray: four, or fewer if the ray is in the middle of one or beside the
    // outer ones.
    const std::int32_t x0 = Cut(at_x, row.width_px - 1), y0 = Cut(at_y, row.height_px - 1);
    const std::int32_t x1 =
        std::min(x0 + (at_x > static_cast<float>(x0) ? 1 : 0), row.width_px - 1);
    const std::int32_t y1 =
        std::min(y0 + (at_y > static_cast<float>(y0) ? 1 : 0), row.height_px - 1);
    const auto misses_by = [&](std::int32_t tap_x, std::int32_t tap_y) {
      return std::abs(row.view_disparity[tap_y * row.width_px + tap_x] - disparity);
    };
    const float upper = misses_by(x0, y0), upper_right = misses_by(x1, y0);
    const float lower = misses_by(x0, y1), lower_right = misses_by(x1, y1);
    const int agrees = static_cast<int>(upper <= row.same_surface) |
                       static_cast<int>(upper_right <= row.same_surface) |
                       static_cast<int>(lower <= row.same_surface) |
                       static_cast<int>(lower_right <= row.same_surface);
    const int is_inside = static_cast<int>(at_x >= -0.5F) & static_cast<int>(at_x <= outer_x) &
                          static_cast<int>(at_y >= -0.5F) & static_cast<int>(at_y <= outer_y);
    const int comes_through = (agrees & is_inside) | static_cast<int>(row.known[x] != 0);
    share[x] += comes_through != 0 ? row.weight : 0.0F;
  }
}

#if defined(__x86_64__)

__attribute__((target("avx2"))) void AddAvx2(const VisibleRow& row, float* share) {
  Add(row, share);
}

#endif

}  // namespace

void AddVisible(const VisibleRow& row, float* share) {
#if defined(__x86_64__)
  if (HasAvx2()) return AddAvx2(row, share);
#endif
  Add(row, share);
}

}  // namespace thicklens::kernels
