#ifndef THICKLENS_ESTIMATOR_DEPTH_HOLE_REGION_H_
#define THICKLENS_ESTIMATOR_DEPTH_HOLE_REGION_H_

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "estimator/depth/surface_plane.h"
#include "thicklens/estimator/disparity_map.h"

namespace thicklens::estimator {

// A known pixel beside a hole.
struct RimPixel {
  int index = 0;
  int group = -1;  // -1: an isolated value, which is ignored
};

// Missing pixels connected by sides or corners, and the known values around them.
struct HoleRegion {
  std::vector<int> pixels;  // ascending
  std::vector<RimPixel> rim;
  // Rim pixels of one group are adjacent without a jump: one surface, as far as the rim shows.
  // Known pixels behind the rim are included as well if the region touches the border of the image
  // or its rim has several groups.
  std::vector<SurfacePlane> planes;  // one per group
  int widest_px = 0;                 // maximum distance to a known pixel
};

// Finds the holes of a map, one after the other.
class HoleFinder {
 public:
  // Neighbours whose disparities differ by more than `jump` are of two surfaces. The map must
  // outlive the finder.
  HoleFinder(const DisparityMap& map, double jump);

  // Returns false if there is no further hole.
  bool Next(HoleRegion* region);

  bool IsHole(int index) const {
    return std::isnan(map_.disparity[static_cast<std::size_t>(index)]);
  }
  // Returns whether the pixel belongs to that region, which must be the last one found.
  bool IsIn(const HoleRegion& region, int index) const {
    const auto place =
        static_cast<std::size_t>(PlaceOf(index));  // the place may be of another region
    return IsHole(index) && place < region.pixels.size() && region.pixels[place] == index;
  }
  // Calls visit(neighbour, dx, dy) for the 4 or all 8 neighbours inside the image.
  template <int kCount, typename Visit>
  void ForNeighbours(int index, const Visit& visit) const {
    const int x = index % width_;
    const int y = index / width_;
    for (int n = 0; n < kCount; ++n) {
      const int dx = kAround[static_cast<std::size_t>(n)][0];
      const int dy = kAround[static_cast<std::size_t>(n)][1];
      if (x + dx < 0 || x + dx >= width_ || y + dy < 0 || y + dy >= height_) continue;
      visit(index + dy * width_ + dx, dx, dy);
    }
  }
  // Returns an index into the last region: into its pixels for a hole, into its rim for a known
  // pixel.
  int PlaceOf(int index) const { return place_[static_cast<std::size_t>(index)]; }
  // Chessboard distance of a hole to the nearest known pixel.
  int DistancePx(int index) const;
  int X(int index) const { return index % width_; }
  int Y(int index) const { return index / width_; }
  double Disparity(int index) const { return map_.disparity[static_cast<std::size_t>(index)]; }

 private:
  static constexpr std::array<std::array<int, 2>, 8> kAround{
      {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, 1}, {1, -1}, {-1, -1}}};

  void Spread(int first, HoleRegion* region);
  void FindRim(HoleRegion* region);
  void GroupRim(HoleRegion* region);
  bool IsOnRim(const HoleRegion& region, int index) const;
  bool IsJump(int a, int b) const;
  int Beyond(int index, int dx, int dy) const;
  void FitPlanes(HoleRegion* region);
  void CollectSurface(std::size_t group, int depth_px);

  const DisparityMap& map_;
  const double jump_;
  const int width_, height_;
  cv::Mat distance_px_;  // type float
  int next_ = 0;
  std::vector<std::int32_t> place_;
  std::vector<std::int32_t> seen_;  // number of the last surface that visited the pixel
  std::int32_t surface_ = 0;
  std::vector<int> members_;  // pixels of the rim, group after group
  std::vector<std::size_t> first_member_;
  std::vector<int> front_, next_front_;
  std::vector<SurfaceSample> samples_;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_DEPTH_HOLE_REGION_H_
