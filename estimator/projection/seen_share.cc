#include "estimator/projection/seen_share.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "estimator/cpu/cell_disparity.h"
#include "estimator/views/surface_taps.h"
#include "thicklens/base/parallel.h"

namespace thicklens::estimator {
namespace {

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

// The rays of one view from a row of the centre view's points.
struct SeenRow {
  int width_px, height_px, y;
  float shift_x, shift_y;         // shift of the view, px per unit of disparity
  const float* points_disparity;  // disparity of the row
  const float* view_disparity;    // disparity of the view; NaN: hidden
  const unsigned char* known;     // flags of the row
  float same_surface, weight;
};

// Adds the view's weight to the share of each point whose ray is not occluded. The code has no
// branches, for the vector instructions of the caller that it is inlined into. NaN fails every
// comparison.
inline __attribute__((always_inline)) void AddSeen(const SeenRow& given, float* share) {
  const SeenRow row = given;
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

__attribute__((target("avx2"))) void AddSeenAvx2(const SeenRow& row, float* share) {
  AddSeen(row, share);
}

#endif

void AddSeenOf(const SeenRow& row, float* share) {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) return AddSeenAvx2(row, share);
#endif
  AddSeen(row, share);
}

}  // namespace

std::vector<float> SeenShare(const ViewFan& fan, const DisparityMap& disparity,
                             const std::vector<unsigned char>& known, int threads) {
  const auto same_surface = static_cast<float>(SurfaceTolerance(disparity));
  std::vector<float> share(disparity.disparity.size(), 0.0F);
  ParallelFor(disparity.height_px, threads, [&](int y) {
    const std::size_t at = Index(y) * Index(disparity.width_px);
    for (const FanView& view : fan.views) {
      AddSeenOf({disparity.width_px, disparity.height_px, y,
                 static_cast<float>(view.sees.shift.x()), static_cast<float>(view.sees.shift.y()),
                 disparity.disparity.data() + at, view.sees.disparity.data(), known.data() + at,
                 same_surface, static_cast<float>(view.weight)},
                share.data() + at);
    }
  });
  return share;
}

}  // namespace thicklens::estimator
