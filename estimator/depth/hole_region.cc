#include "estimator/depth/hole_region.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "thicklens/base/index.h"

namespace thicklens::estimator {
namespace {

constexpr std::int32_t kNoPlace = -1;
// A surface is examined as far behind the rim as the hole is wide, within these limits.
constexpr int kMinDepthPx = 3;
constexpr int kMaxDepthPx = 48;
// If some group has so many rim pixels, isolated rim pixels are ignored.
constexpr int kManyRimPixels = 3;

cv::Mat DistanceToKnown(const DisparityMap& map) {
  cv::Mat is_hole(map.height_px, map.width_px, CV_8U);
  std::transform(map.disparity.begin(), map.disparity.end(), is_hole.ptr<unsigned char>(),
                 [](float value) { return std::isnan(value) ? 1 : 0; });
  cv::Mat distance;
  cv::distanceTransform(is_hole, distance, cv::DIST_C, 3);
  return distance;
}

}  // namespace

HoleFinder::HoleFinder(const DisparityMap& map, double jump)
    : map_(map),
      jump_(jump),
      width_(map.width_px),
      height_(map.height_px),
      distance_px_(DistanceToKnown(map)),
      place_(map.disparity.size(), kNoPlace),
      seen_(map.disparity.size(), 0) {}

int HoleFinder::DistancePx(int index) const {
  return static_cast<int>(distance_px_.at<float>(Y(index), X(index)));
}

bool HoleFinder::IsJump(int a, int b) const {
  return !(std::abs(Disparity(a) - Disparity(b)) <= jump_);
}

bool HoleFinder::Next(HoleRegion* region) {
  const auto count = static_cast<int>(map_.disparity.size());
  while (next_ < count && !(IsHole(next_) && place_[Index(next_)] == kNoPlace)) ++next_;
  if (next_ == count) return false;
  Spread(next_, region);
  FindRim(region);
  GroupRim(region);
  FitPlanes(region);
  return true;
}

void HoleFinder::Spread(int first, HoleRegion* region) {
  std::vector<int>& pixels = region->pixels;
  pixels.assign(1, first);
  place_[Index(first)] = 0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    ForNeighbours<8>(pixels[i], [&](int beside, int, int) {
      if (!IsHole(beside) || place_[Index(beside)] != kNoPlace) return;
      place_[Index(beside)] = 0;
      pixels.push_back(beside);
    });
  }
  std::sort(pixels.begin(), pixels.end());
  region->widest_px = 0;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    place_[Index(pixels[i])] = static_cast<std::int32_t>(i);
    region->widest_px = std::max(region->widest_px, DistancePx(pixels[i]));
  }
}

// The place of a known pixel may still be that on the rim of another region.
bool HoleFinder::IsOnRim(const HoleRegion& region, int index) const {
  const std::int32_t place = place_[Index(index)];
  return place >= 0 && Index(place) < region.rim.size() && region.rim[Index(place)].index == index;
}

void HoleFinder::FindRim(HoleRegion* region) {
  region->rim.clear();
  for (const int pixel : region->pixels) {
    ForNeighbours<8>(pixel, [&](int beside, int, int) {
      if (IsHole(beside) || IsOnRim(*region, beside)) return;
      place_[Index(beside)] = static_cast<std::int32_t>(region->rim.size());
      region->rim.push_back({beside, -1});
    });
  }
}

void HoleFinder::GroupRim(HoleRegion* region) {
  std::vector<RimPixel>& rim = region->rim;
  int groups = 0;
  std::size_t largest = 0;
  std::vector<std::size_t> lone;
  members_.clear();
  first_member_.clear();
  for (std::size_t first = 0; first < rim.size(); ++first) {
    if (rim[first].group >= 0) continue;
    rim[first].group = groups;
    front_.assign(1, rim[first].index);
    for (std::size_t i = 0; i < front_.size(); ++i) {
      const int from = front_[i];
      ForNeighbours<8>(from, [&](int beside, int, int) {
        if (IsHole(beside) || !IsOnRim(*region, beside) || IsJump(from, beside)) return;
        RimPixel& there = rim[Index(place_[Index(beside)])];
        if (there.group >= 0) return;
        there.group = groups;
        front_.push_back(beside);
      });
    }
    if (front_.size() == 1) lone.push_back(first);
    largest = std::max(largest, front_.size());
    first_member_.push_back(members_.size());
    members_.insert(members_.end(), front_.begin(), front_.end());
    ++groups;
  }
  first_member_.push_back(members_.size());
  region->planes.resize(Index(groups));
  if (largest < kManyRimPixels) return;
  for (const std::size_t i : lone) rim[i].group = -1;
}

// Returns -1 outside of the image.
int HoleFinder::Beyond(int index, int dx, int dy) const {
  const int x = X(index) + dx;
  const int y = Y(index) + dy;
  return x >= 0 && x < width_ && y >= 0 && y < height_ ? y * width_ + x : -1;
}

// Collects a surface across holes of one pixel as well, because speckle does not separate surfaces.
void HoleFinder::CollectSurface(std::size_t group, int depth_px) {
  ++surface_;
  samples_.clear();
  front_.clear();
  const auto take = [this](int index) {
    seen_[Index(index)] = surface_;
    samples_.push_back({X(index), Y(index), Disparity(index)});
  };
  for (std::size_t i = first_member_[group]; i < first_member_[group + 1]; ++i) {
    take(members_[i]);
    front_.push_back(members_[i]);
  }
  for (int depth = 0; depth < depth_px; ++depth) {
    next_front_.clear();
    for (const int from : front_) {
      ForNeighbours<4>(from, [&](int beside, int dx, int dy) {
        const int next = IsHole(beside) ? Beyond(beside, dx, dy) : beside;
        if (next < 0 || seen_[Index(next)] == surface_ || IsJump(from, next)) return;
        take(next);
        next_front_.push_back(next);
      });
    }
    front_.swap(next_front_);
  }
}

void HoleFinder::FitPlanes(HoleRegion* region) {
  const bool is_open = std::any_of(region->pixels.begin(), region->pixels.end(), [this](int pixel) {
    return X(pixel) == 0 || X(pixel) == width_ - 1 || Y(pixel) == 0 || Y(pixel) == height_ - 1;
  });
  const bool rim_is_enough = !is_open && region->planes.size() == 1;
  const int depth_px = rim_is_enough ? 0 : std::clamp(region->widest_px, kMinDepthPx, kMaxDepthPx);
  for (std::size_t group = 0; group < region->planes.size(); ++group) {
    CollectSurface(group, depth_px);
    region->planes[group] = FitSurfacePlane(samples_);
  }
}

}  // namespace thicklens::estimator
