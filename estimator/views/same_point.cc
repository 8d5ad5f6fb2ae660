#include "estimator/views/same_point.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace thicklens::estimator {
namespace {

// A sample does not show a point whose disparity differs from the sample's by more than this.
constexpr double kSamePointPx = 0.3;

}  // namespace

bool ShowsSamePoint(const DisparityMap& map, const std::vector<float>& of_view, double s, double t,
                    double disparity) {
  const double px_per_unit = std::max(std::abs(map.step.x()), std::abs(map.step.y()));
  // The range is checked before the conversion to integers; NaN is outside as well.
  if (!(s >= 0 && s <= map.width_px - 1 && t >= 0 && t <= map.height_px - 1)) return false;
  const auto s0 = static_cast<std::size_t>(std::floor(s));
  const auto t0 = static_cast<std::size_t>(std::floor(t));
  const std::size_t s1 = s > static_cast<double>(s0) ? s0 + 1 : s0;
  const std::size_t t1 = t > static_cast<double>(t0) ? t0 + 1 : t0;
  for (const std::size_t tt : {t0, t1}) {
    for (const std::size_t ss : {s0, s1}) {
      const double there = of_view[tt * static_cast<std::size_t>(map.width_px) + ss];
      if (!(std::abs(there - disparity) * px_per_unit <= kSamePointPx)) return false;
    }
  }
  return true;
}

}  // namespace thicklens::estimator
