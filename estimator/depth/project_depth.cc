#include "thicklens/estimator/project_depth.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "estimator/depth/depth_surfaces.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"

namespace thicklens::estimator {
namespace {

// One corner of a triangle on the grid of the other camera.
struct Corner {
  Eigen::Vector2d at;
  double value, confidence;
};

class NearestOfGrid {
 public:
  NearestOfGrid(int width_px, int height_px, bool has_confidence) {
    grid_.width_px = width_px;
    grid_.height_px = height_px;
    grid_.values.assign(Index(width_px) * Index(height_px),
                        std::numeric_limits<float>::quiet_NaN());
    if (has_confidence) grid_.confidence.assign(grid_.values.size(), 0.0F);
  }

  void Add(int x, int y, double value, double confidence) {
    if (x < 0 || y < 0 || x >= grid_.width_px || y >= grid_.height_px) return;
    const std::size_t i = Index(y) * Index(grid_.width_px) + Index(x);
    float& there = grid_.values[i];
    if (!std::isnan(there) && static_cast<double>(there) >= value) return;
    there = static_cast<float>(value);
    if (!grid_.confidence.empty()) grid_.confidence[i] = static_cast<float>(confidence);
  }

  void AddTriangle(const std::array<Corner, 3>& corners) {
    const Eigen::Vector2d a = corners[0].at, b = corners[1].at - a, c = corners[2].at - a;
    const double area = b.x() * c.y() - b.y() * c.x();
    if (!(std::abs(area) > 1e-12)) return;
    Eigen::Vector2d low = a, high = a;
    for (const Corner& corner : corners) {
      low = low.cwiseMin(corner.at);
      high = high.cwiseMax(corner.at);
    }
    const int left = std::max(0, static_cast<int>(std::ceil(std::max(low.x(), -1.0))));
    const int top = std::max(0, static_cast<int>(std::ceil(std::max(low.y(), -1.0))));
    const double right = std::min(high.x(), grid_.width_px - 1.0);
    const double bottom = std::min(high.y(), grid_.height_px - 1.0);
    constexpr double kEdge = -1e-9;  // a sample on the edge of two triangles belongs to both
    for (int y = top; y <= bottom; ++y) {
      for (int x = left; x <= right; ++x) {
        const Eigen::Vector2d p = Eigen::Vector2d(x, y) - a;
        const double of_b = (p.x() * c.y() - p.y() * c.x()) / area;
        const double of_c = (b.x() * p.y() - b.y() * p.x()) / area;
        const double of_a = 1 - of_b - of_c;
        if (of_a < kEdge || of_b < kEdge || of_c < kEdge) continue;
        Add(x, y, of_a * corners[0].value + of_b * corners[1].value + of_c * corners[2].value,
            of_a * corners[0].confidence + of_b * corners[1].confidence +
                of_c * corners[2].confidence);
      }
    }
  }

  DepthSampling Take() { return std::move(grid_); }

 private:
  DepthSampling grid_;
};

}  // namespace

DepthSampling ProjectDepth(const DepthSampling& map, const SeenSamples& seen, int width_px,
                           int height_px) {
  const std::size_t count = Index(std::max(map.width_px, 0)) * Index(std::max(map.height_px, 0));
  if (count == 0 || map.values.size() != count || seen.positions.size() != count ||
      seen.values.size() != count || width_px < 1 || height_px < 1) {
    throw Error(fmt::format(
        "a depth map of {} x {} px has {} values, {} positions and {} depths in the other camera: "
        "the sizes must fit",
        map.width_px, map.height_px, map.values.size(), seen.positions.size(), seen.values.size()));
  }
  const DepthSurfaces surfaces(map);
  const auto at = [&](int x, int y) { return Index(y) * Index(map.width_px) + Index(x); };
  const auto is_seen = [&](int x, int y) {
    const std::size_t i = at(x, y);
    return !std::isnan(surfaces.value(x, y)) && seen.values[i] > 0 &&
           std::isfinite(seen.values[i]) && seen.positions[i].allFinite();
  };
  const auto corner = [&](int x, int y) {
    return Corner{seen.positions[at(x, y)], static_cast<double>(seen.values[at(x, y)]),
                  static_cast<double>(surfaces.weight(x, y))};
  };
  // Directions of DepthSurfaces::kSteps.
  constexpr std::size_t kRight = 0, kDown = 1, kDownRight = 2, kDownLeft = 3;
  NearestOfGrid grid(width_px, height_px, !map.confidence.empty());
  std::vector<bool> is_drawn(count, false);
  const auto draw = [&](const std::array<std::array<int, 2>, 3>& of) {
    std::array<Corner, 3> corners;
    for (std::size_t n = 0; n < of.size(); ++n) {
      if (!is_seen(of[n][0], of[n][1])) return;
      corners[n] = corner(of[n][0], of[n][1]);
    }
    grid.AddTriangle(corners);
    for (const auto& [x, y] : of) is_drawn[at(x, y)] = true;
  };
  for (int y = 0; y + 1 < map.height_px; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x + 1 < map.width_px; ++x) {
      const bool upper = surfaces.IsLinked(x, y, kRight), left = surfaces.IsLinked(x, y, kDown);
      const bool lower = surfaces.IsLinked(x, y + 1, kRight);
      const bool right = surfaces.IsLinked(x + 1, y, kDown);
      if (surfaces.IsLinked(x, y, kDownRight)) {
        if (upper && right) draw({{{x, y}, {x + 1, y}, {x + 1, y + 1}}});
        if (left && lower) draw({{{x, y}, {x, y + 1}, {x + 1, y + 1}}});
      } else if (surfaces.IsLinked(x + 1, y, kDownLeft)) {
        if (upper && left) draw({{{x, y}, {x + 1, y}, {x, y + 1}}});
        if (right && lower) draw({{{x + 1, y}, {x + 1, y + 1}, {x, y + 1}}});
      }
    }
  }
  for (int y = 0; y < map.height_px; ++y) {
    for (int x = 0; x < map.width_px; ++x) {
      if (is_drawn[at(x, y)] || !is_seen(x, y)) continue;
      const Corner alone = corner(x, y);
      constexpr double kFar = 1e6;  // of the grid, so that the position fits an int
      if (alone.at.cwiseAbs().maxCoeff() > kFar) continue;
      grid.Add(static_cast<int>(std::lround(alone.at.x())),
               static_cast<int>(std::lround(alone.at.y())), alone.value, alone.confidence);
    }
  }
  return grid.Take();
}

}  // namespace thicklens::estimator
