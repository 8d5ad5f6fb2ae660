#include "estimator/depth/geodesic_voronoi_labels.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "thicklens/base/index.h"

namespace thicklens::estimator {
namespace {

// Step of the roots that costs as much as one px of path in a narrow hole.
constexpr double kDefaultStep = 0.02;
// Increase of the cost of edges per px of a hole's width: edges of 0.1 must outweigh the head start
// of the surface behind.
constexpr double kEdgePerWidth = 0.1;
constexpr int kMaxLevels = 4;
constexpr int kMaxRounds = 3;
constexpr float kMaxBuckets = 4096;

}  // namespace

bool HasPlane(const HoleRegion& region, const RimPixel& rim, double jump) {
  return rim.group >= 0 && region.planes[Index(rim.group)].rms <= jump;
}

double SurfaceAt(const HoleFinder& finder, const HoleRegion& region, const RimPixel& rim, int pixel,
                 double jump) {
  if (!HasPlane(region, rim, jump)) return finder.Disparity(rim.index);
  return region.planes[Index(rim.group)].At(finder.X(pixel), finder.Y(pixel));
}

GeodesicVoronoiLabels::GeodesicVoronoiLabels(const HoleFinder& finder,
                                             const model::LinearImage& roots, double jump)
    : finder_(finder),
      roots_(roots),
      jump_(jump),
      waiting_(static_cast<std::size_t>(kMaxBuckets)) {}

void GeodesicVoronoiLabels::Find(const HoleRegion& region, std::vector<int>* rim_of,
                                 std::vector<double>* start) {
  edge_cost_ = std::max(1.0, kEdgePerWidth * (2 * region.widest_px + 1)) /
               (kDefaultStep * kDefaultStep * roots_.channels);
  width_px_.clear();
  near_and_far_.clear();
  std::vector<int> levels(region.planes.size(), 0);
  // Behind a near surface other surfaces may meet.
  for (int round = 0; round < kMaxRounds; ++round) {
    Spread(region, levels, rim_of);
    Start(region, *rim_of, start);
    if (round + 1 == kMaxRounds) return;
    std::vector<int> found = LevelsOf(region, *rim_of, *start);
    if (found == levels) return;
    levels = std::move(found);
    if (width_px_.empty()) FindWidths(region);
  }
}

// Dijkstra's shortest paths from the whole rim at once. Pixels wait in buckets of nearly equal
// cost, and again where a shorter path is found.
void GeodesicVoronoiLabels::Spread(const HoleRegion& region, const std::vector<int>& levels,
                                   std::vector<int>* rim_of) {
  cost_.assign(region.pixels.size(), std::numeric_limits<float>::infinity());
  rim_of->assign(region.pixels.size(), -1);
  std::size_t last_bucket = 0;
  const auto reach = [&](int from, int from_width_px, float cost, int rim, int pixel, int dx,
                         int dy) {
    const std::size_t place = Index(finder_.PlaceOf(pixel));
    const int level = levels[Index(region.rim[Index(rim)].group)];
    const int wider_px = level == 0 ? 0 : std::max(0, width_px_[place] - from_width_px);
    const float there =
        cost + StepCost(from, pixel, dx != 0 && dy != 0) + static_cast<float>(level * wider_px);
    if (!(there < cost_[place])) return;
    cost_[place] = there;
    (*rim_of)[place] = rim;
    const auto bucket = static_cast<std::size_t>(std::min(there, kMaxBuckets - 1.0F));
    last_bucket = std::max(last_bucket, bucket);
    waiting_[bucket].push_back({there, static_cast<int>(place)});
  };
  for (std::size_t i = 0; i < region.rim.size(); ++i) {
    if (region.rim[i].group < 0) continue;
    const int from = region.rim[i].index;
    finder_.ForNeighbours<8>(from, [&](int beside, int dx, int dy) {
      // The rim pixel may also border another hole.
      if (finder_.IsIn(region, beside)) reach(from, 0, 0, static_cast<int>(i), beside, dx, dy);
    });
  }
  for (std::size_t bucket = 0; bucket <= last_bucket; ++bucket) {
    for (std::size_t i = 0; i < waiting_[bucket].size(); ++i) {
      const Waiting next = waiting_[bucket][i];
      const std::size_t place = Index(next.place);
      if (next.cost > cost_[place]) continue;
      const int from = region.pixels[place];
      const int width_px = width_px_.empty() ? 0 : width_px_[place];
      finder_.ForNeighbours<8>(from, [&](int beside, int dx, int dy) {
        if (!finder_.IsHole(beside)) return;
        reach(from, width_px, next.cost, (*rim_of)[place], beside, dx, dy);
      });
    }
    waiting_[bucket].clear();
  }
}

void GeodesicVoronoiLabels::Start(const HoleRegion& region, const std::vector<int>& rim_of,
                                  std::vector<double>* start) const {
  start->resize(region.pixels.size());
  for (std::size_t i = 0; i < region.pixels.size(); ++i) {
    (*start)[i] = SurfaceAt(finder_, region, region.rim[Index(rim_of[i])], region.pixels[i], jump_);
  }
}

// The level is 1 for a group that meets a farther one, now or in an earlier round, and one more
// than the levels of the groups behind it that it meets.
std::vector<int> GeodesicVoronoiLabels::LevelsOf(const HoleRegion& region,
                                                 const std::vector<int>& rim_of,
                                                 const std::vector<double>& start) {
  const auto meet = [&](int group, double disparity, int other, double other_disparity) {
    if (group == other || group < 0 || other < 0) return;
    if (disparity - other_disparity > jump_) near_and_far_.emplace_back(group, other);
    if (other_disparity - disparity > jump_) near_and_far_.emplace_back(other, group);
  };
  for (std::size_t i = 0; i < region.pixels.size(); ++i) {
    const int group = region.rim[Index(rim_of[i])].group;
    finder_.ForNeighbours<4>(region.pixels[i], [&](int beside, int, int) {
      const std::size_t place = Index(finder_.PlaceOf(beside));
      if (finder_.IsHole(beside)) {
        if (place > i) meet(group, start[i], region.rim[Index(rim_of[place])].group, start[place]);
      } else {
        meet(group, start[i], region.rim[place].group, finder_.Disparity(beside));
      }
    });
  }
  std::sort(near_and_far_.begin(), near_and_far_.end());
  near_and_far_.erase(std::unique(near_and_far_.begin(), near_and_far_.end()), near_and_far_.end());
  std::vector<int> levels(region.planes.size(), 0);
  for (int round = 0; round < kMaxLevels; ++round) {
    for (const auto& [near, far] : near_and_far_) {
      levels[Index(near)] =
          std::min(kMaxLevels, std::max(levels[Index(near)], levels[Index(far)] + 1));
    }
  }
  return levels;
}

float GeodesicVoronoiLabels::StepCost(int from, int to, bool diagonal) const {
  const float* a = roots_.values.data() + Index(from) * Index(roots_.channels);
  const float* b = roots_.values.data() + Index(to) * Index(roots_.channels);
  float squared = 0;
  for (int channel = 0; channel < roots_.channels; ++channel) {
    const float step = a[channel] - b[channel];
    squared += step * step;
  }
  return (diagonal ? 1.41421356F : 1.0F) + static_cast<float>(edge_cost_) * squared;
}

// Sets the width of the hole around each pixel, along the ascent to the greatest distance from the
// rim. Pixels that are farther from the rim are processed first.
void GeodesicVoronoiLabels::FindWidths(const HoleRegion& region) {
  std::vector<std::vector<int>> at_distance(Index(region.widest_px) + 1);
  for (const int pixel : region.pixels) {
    at_distance[Index(finder_.DistancePx(pixel))].push_back(pixel);
  }
  width_px_.resize(region.pixels.size());
  for (auto pixels = at_distance.rbegin(); pixels != at_distance.rend(); ++pixels) {
    for (const int pixel : *pixels) {
      const int distance_px = finder_.DistancePx(pixel);
      int width_px = 2 * distance_px + 1;
      finder_.ForNeighbours<8>(pixel, [&](int beside, int, int) {
        if (finder_.DistancePx(beside) <= distance_px) return;
        width_px = std::max(width_px, width_px_[Index(finder_.PlaceOf(beside))]);
      });
      width_px_[Index(finder_.PlaceOf(pixel))] = width_px;
    }
  }
}

}  // namespace thicklens::estimator
