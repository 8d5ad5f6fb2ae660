#include "thicklens/model/depth_places.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>

#include "thicklens/base/cancel.h"

namespace thicklens::model {
namespace {

constexpr int kPlaceBlockPx = 8;

class DepthBlocks {
 public:
  DepthBlocks(const Camera& camera, const Scene& scene)
      : scene_(scene),
        focus_(1 / camera.focus_depth_mm()),
        axis_px_(camera.sensor.principal_point_px) {}

  // Returns none if the block contains only holes.
  std::optional<EffectSite> PlaceOf(int x0, int y0) const {
    EffectSite place;
    bool found = false;
    double steepest = 0;
    for (int y = y0; y < std::min(y0 + kPlaceBlockPx, scene_.image.height_px); ++y) {
      for (int x = x0; x < std::min(x0 + kPlaceBlockPx, scene_.image.width_px); ++x) {
        const double here = InverseDepth(x, y);
        if (std::isnan(here)) continue;
        if (!found || std::abs(here - focus_) > std::abs(1 / place.depth_mm - focus_)) {
          place.depth_mm = 1 / here;
        }
        const Eigen::Vector2d at_px(x, y);
        if (!found || (at_px - axis_px_).norm() > (place.position_px - axis_px_).norm()) {
          place.position_px = at_px;
        }
        found = true;
        steepest = std::max({steepest, Step(here, x + 1, y), Step(here, x, y + 1)});
      }
    }
    if (!found) return std::nullopt;
    // The other surface lies beyond the plane of focus, as far away as possible.
    const double here = 1 / place.depth_mm;
    const double there = here > focus_ ? here - steepest : here + steepest;
    if (steepest > 0) place.other_depth_mm = there > 0 ? 1 / there : 1 / (here + steepest);
    return place;
  }

 private:
  double InverseDepth(int x, int y) const {
    return 1 /
           static_cast<double>(scene_.depth_mm[static_cast<std::size_t>(y) *
                                                   static_cast<std::size_t>(scene_.image.width_px) +
                                               static_cast<std::size_t>(x)]);
  }
  double Step(double here, int x, int y) const {
    if (x >= scene_.image.width_px || y >= scene_.image.height_px) return 0;
    const double step = std::abs(InverseDepth(x, y) - here);
    return std::isnan(step) ? 0 : step;
  }

  const Scene& scene_;
  const double focus_;
  const Eigen::Vector2d axis_px_;
};

}  // namespace

std::vector<EffectSite> PlacesOfDepth(const Camera& camera, const Scene& scene) {
  const DepthBlocks blocks(camera, scene);
  std::vector<EffectSite> places;
  for (int y = 0; y < scene.image.height_px; y += kPlaceBlockPx) {
    ThrowIfCancelled();
    for (int x = 0; x < scene.image.width_px; x += kPlaceBlockPx) {
      if (const auto place = blocks.PlaceOf(x, y)) places.push_back(*place);
    }
  }
  return places;
}

}  // namespace thicklens::model
