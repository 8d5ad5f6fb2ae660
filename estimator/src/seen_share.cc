#include "seen_share.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "surface_taps.h"
#include "thicklens/model/parallel.h"

namespace thicklens::estimator {
namespace {

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

// The pixels of a line around a place on it: two, or one if it is in the middle of that.
struct Around {
  int below = 0, above = 0;
};
// False beyond the outer edges of the line's pixels.
bool FindAround(float at, int count, Around* around) {
  if (!(at >= -0.5F) || !(at <= static_cast<float>(count) - 0.5F)) return false;
  const float inside = std::clamp(at, 0.0F, static_cast<float>(count - 1));
  around->below = static_cast<int>(inside);
  around->above = static_cast<int>(std::ceil(inside));
  return true;
}

// Whether the ray of one view from the point at (x, y) comes through to the photograph.
bool ComesThrough(const CompactView& view, const DisparityMap& map, float tolerance, int x, int y) {
  const float disparity = map.disparity[Index(y) * Index(map.width_px) + Index(x)];
  Around across, down;
  if (!FindAround(static_cast<float>(x) - static_cast<float>(view.shift.x()) * disparity,
                  map.width_px, &across) ||
      !FindAround(static_cast<float>(y) - static_cast<float>(view.shift.y()) * disparity,
                  map.height_px, &down)) {
    return false;
  }
  const auto agrees = [&](int tap_x, int tap_y) {  // a hidden sample is NaN
    const float there = view.disparity[Index(tap_y) * Index(map.width_px) + Index(tap_x)];
    return std::abs(there - disparity) <= tolerance;
  };
  return agrees(across.below, down.below) || agrees(across.above, down.below) ||
         agrees(across.below, down.above) || agrees(across.above, down.above);
}

}  // namespace

std::vector<float> SeenShare(const ViewFan& fan, const DisparityMap& disparity,
                             const std::vector<unsigned char>& known, int threads) {
  const auto tolerance = static_cast<float>(SurfaceTolerance(disparity));
  std::vector<float> share(disparity.disparity.size(), 0.0F);
  model::ParallelFor(disparity.height_px, threads, [&](int y) {
    float* const row = share.data() + Index(y) * Index(disparity.width_px);
    const unsigned char* const known_row = known.data() + Index(y) * Index(disparity.width_px);
    for (const FanView& view : fan.views) {
      const auto weight = static_cast<float>(view.weight);
      for (int x = 0; x < disparity.width_px; ++x) {
        if (known_row[x] != 0 || ComesThrough(view.sees, disparity, tolerance, x, y))
          row[x] += weight;
      }
    }
  });
  return share;
}

}  // namespace thicklens::estimator
