#include "thicklens/estimator/disparity_map.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "thicklens/base/error.h"
#include "thicklens/base/index.h"

namespace thicklens::estimator {
namespace {

constexpr float kHole = std::numeric_limits<float>::quiet_NaN();

void CheckCount(const char* what, int width_px, int height_px, int channels, std::size_t count) {
  if (width_px < 1 || height_px < 1 || channels < 1 ||
      count != Index(width_px) * Index(height_px) * Index(channels)) {
    throw Error(
        fmt::format("{}: {} values for {}x{} px in {} channels: the count must be the product of "
                    "these numbers, and not 0",
                    what, count, width_px, height_px, channels));
  }
}

}  // namespace

// disparity * step = -m, m = (1 - d0/(z - zl)) du/ds of model::SlopeOnGrid, and the same in v. The
// disparity is that of a step of 1 mm, in px per mm: (d0/(z - zl) - 1)/ds. Both factors are negated
// where d0 < 0, so that nearer points always have the larger disparity.
DisparityMap DisparityOnGrid(const model::LightFieldGrid& grid, const std::vector<float>& depth_mm,
                             int width_px, int height_px) {
  CheckCount("depth map", width_px, height_px, 1, depth_mm.size());
  const double sign = grid.planes.plane_spacing_mm < 0 ? -1 : 1;
  model::LightFieldGrid per_mm = grid;
  per_mm.u_step_mm = sign;

  DisparityMap map;
  map.width_px = width_px;
  map.height_px = height_px;
  map.step = {sign * grid.u_step_mm, sign * grid.v_step_mm * grid.s_step_mm / grid.t_step_mm};
  map.disparity.reserve(depth_mm.size());
  for (const float z_mm : depth_mm) {
    if (std::isnan(z_mm)) {
      map.disparity.push_back(kHole);
      continue;
    }
    if (!(z_mm > grid.planes.uv_depth_mm)) {
      throw Error(fmt::format(
          "depth map: a depth is {} mm: every depth must be beyond the UV plane, > {} mm", z_mm,
          grid.planes.uv_depth_mm));
    }
    map.disparity.push_back(static_cast<float>(-model::SlopeOnGrid(per_mm, z_mm)));
  }
  return map;
}

double DisparityAtInfinity(const model::LightFieldGrid& grid) {
  constexpr float kVeryFarMm = 1e15F;  // the disparity tends to its limit with 1/z
  return DisparityOnGrid(grid, {kVeryFarMm}, 1, 1).disparity.front();
}

DisparityMap DisparityFromMap(const model::RawDepthMap& map, double scale, double offset_px) {
  CheckCount("disparity map", map.width_px, map.height_px, 1, map.values.size());
  if (!std::isfinite(scale) || scale == 0) {
    throw Error(fmt::format("disparity map: the scale is {}: it must be finite and not 0", scale));
  }
  if (!std::isfinite(offset_px)) {
    throw Error(fmt::format("disparity map: the offset is {} px: it must be finite", offset_px));
  }
  DisparityMap disparity{map.width_px, map.height_px, {}, {1, 1}};
  disparity.disparity.reserve(map.values.size());
  bool all_holes = true;
  for (const float value : map.values) {
    const auto px = static_cast<float>(scale * value + offset_px);
    const bool hole = !std::isfinite(px) || (map.integer && value == 0);
    disparity.disparity.push_back(hole ? kHole : px);
    all_holes = all_holes && hole;
  }
  if (all_holes) {
    throw Error(fmt::format(
        "disparity map: all of its {} values are holes{}: at least one must be a disparity",
        map.values.size(),
        map.integer ? " (0 in an integer map, or not finite)" : " (not finite)"));
  }
  return disparity;
}

}  // namespace thicklens::estimator
