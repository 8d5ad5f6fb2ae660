#include "thicklens/estimator/fill_holes.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "estimator/depth/geodesic_voronoi_labels.h"
#include "estimator/depth/hole_region.h"
#include "thicklens/base/error.h"
#include "thicklens/base/index.h"
#include "thicklens/estimator/estimate_checks.h"

namespace thicklens::estimator {
namespace {

// Neighbours whose disparities differ by more than this belong to two surfaces: a multiple of the
// noise of the map, limited to a minimum and a maximum in px per view step.
constexpr double kJumpOfNoise = 6;
constexpr double kMinJumpPx = 0.2;
constexpr double kMaxJumpPx = 1;
// Sweeps of successive over-relaxation that a hole needs for each px of distance to a known pixel,
// and the number available to all holes of a map together. Holes that are too large for this are
// bent only near their rims.
constexpr double kSweepsPerPx = 6;
constexpr double kSweepsOfAll = 16;
constexpr double kMaxUpdates = 1e6;  // in addition

// Solves for one hole: each pixel's disparity u is the mean over its neighbours of u + (p - q)
// slope, where the slope is the mean of their planes' slopes. Pixels of different surfaces are not
// neighbours. An exact plane solves this, whatever its borders are, and the residual of the planes
// is spread between the rims as a membrane.
class SurfaceRelaxation {
 public:
  SurfaceRelaxation(const HoleFinder& finder, const HoleRegion& region, double jump,
                    double most_sweeps)
      : finder_(finder), region_(region), jump_(jump), most_sweeps_(most_sweeps) {}

  // `rim_of` and `disparity` belong to the region's pixels; `disparity` holds the start and
  // receives the solution.
  void Solve(const std::vector<int>& rim_of, std::vector<double>* disparity) {
    Link(rim_of, *disparity);
    const double sweeps = std::min(kSweepsPerPx * region_.widest_px, most_sweeps_);
    // This is the optimum for a strip as wide as so many sweeps can reach.
    const double reach_px = sweeps / kSweepsPerPx;
    const double omega = 2 / (1 + std::sin(3.14159265358979 / (2 * reach_px + 1)));
    for (int sweep = 0; sweep < static_cast<int>(sweeps); ++sweep) {
      for (std::size_t i = 0; i < links_.size(); ++i) Relax(links_[i], omega, i, disparity);
    }
  }

 private:
  struct Links {
    std::array<int, 4> others{-1, -1, -1, -1};  // places of pixels without a depth
    double known = 0;                           // sum over the rim's values and all (p - q) slope
    double share = 0;                           // one over the number of neighbours
  };

  static void Relax(const Links& links, double omega, std::size_t i, std::vector<double>* values) {
    if (links.share == 0) return;
    double sum = links.known;
    for (const int other : links.others) {
      if (other >= 0) sum += (*values)[Index(other)];
    }
    (*values)[i] += omega * (sum * links.share - (*values)[i]);
  }

  void Link(const std::vector<int>& rim_of, const std::vector<double>& start) {
    links_.assign(region_.pixels.size(), {});
    for (std::size_t i = 0; i < links_.size(); ++i) {
      Links& links = links_[i];
      const RimPixel& own = region_.rim[Index(rim_of[i])];
      std::size_t n = 0;
      int count = 0;
      finder_.ForNeighbours<4>(region_.pixels[i], [&](int beside, int dx, int dy) {
        const std::size_t place = Index(finder_.PlaceOf(beside));
        const bool is_hole = finder_.IsHole(beside);
        const RimPixel& other = region_.rim[is_hole ? Index(rim_of[place]) : place];
        const double there = is_hole ? start[place] : finder_.Disparity(beside);
        const bool same = own.group == other.group && HasPlane(region_, own, jump_);
        if (!same && !(std::abs(start[i] - there) <= jump_)) return;
        const Eigen::Vector2d slope = (SlopeOf(own) + SlopeOf(other)) / 2;
        links.known -= slope.dot(Eigen::Vector2d(dx, dy));
        ++count;
        if (is_hole) {
          links.others[n++] = static_cast<int>(place);
        } else {
          links.known += there;
        }
      });
      if (count > 0) links.share = 1.0 / count;
    }
  }

  Eigen::Vector2d SlopeOf(const RimPixel& rim) const {
    if (!HasPlane(region_, rim, jump_)) return {0, 0};
    return region_.planes[Index(rim.group)].slope;
  }

  const HoleFinder& finder_;
  const HoleRegion& region_;
  const double jump_, most_sweeps_;
  std::vector<Links> links_;
};

model::LinearImage RootsOf(const model::LinearImage& image) {
  model::LinearImage roots = image;
  for (float& value : roots.values) value = value > 0 ? std::sqrt(value) : 0.0F;
  return roots;
}

// Range of credible disparities. Planes that lead far beyond all known values are rejected, and no
// plane leads beyond infinity.
struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -std::numeric_limits<double>::infinity();
};
Range PlausibleRange(const DisparityMap& map, double at_infinity) {
  Range range;
  for (const float value : map.disparity) {
    if (std::isnan(value)) continue;
    range.low = std::min(range.low, static_cast<double>(value));
    range.high = std::max(range.high, static_cast<double>(value));
  }
  const double beyond = range.high - range.low;
  return {std::max(range.low - beyond, std::min(at_infinity, range.low)), range.high + beyond};
}

void CheckSizes(const DisparityMap& map, const model::LinearImage& image) {
  const std::size_t pixels = Index(map.width_px) * Index(map.height_px);
  if (map.width_px < 1 || map.height_px < 1 || map.disparity.size() != pixels) {
    throw Error(
        fmt::format("disparity map: {} values for {}x{} px: the count must be the product of these "
                    "numbers, and not 0",
                    map.disparity.size(), map.width_px, map.height_px));
  }
  if (image.width_px != map.width_px || image.height_px != map.height_px || image.channels < 1 ||
      image.values.size() != pixels * Index(image.channels)) {
    throw Error(
        fmt::format("disparity map: it has {}x{} px, but the image has {}x{} px in {} channel(s) "
                    "with {} values: the sizes must be equal",
                    map.width_px, map.height_px, image.width_px, image.height_px, image.channels,
                    image.values.size()));
  }
  const auto bad = std::find_if_not(image.values.begin(), image.values.end(),
                                    [](float value) { return std::isfinite(value); });
  if (bad != image.values.end()) {
    const auto pixel = (bad - image.values.begin()) / image.channels;
    throw Error(fmt::format("image: a value of pixel ({}, {}) is {}: it must be finite",
                            pixel % image.width_px, pixel / image.width_px, *bad));
  }
}

double JumpOf(const DisparityMap& map) {
  const double px_per_unit = map.step.cwiseAbs().maxCoeff();
  const double noise_px = DepthNoisePx(map).value_or(0);
  return std::clamp(kJumpOfNoise * noise_px, kMinJumpPx, kMaxJumpPx) / px_per_unit;
}

void Fill(const DisparityMap& map, const model::LinearImage& image, std::size_t holes,
          double at_infinity, DisparityMap* full) {
  const double jump = JumpOf(map);
  const Range range = PlausibleRange(map, at_infinity);
  const model::LinearImage roots = RootsOf(image);
  const double most_sweeps = kSweepsOfAll + kMaxUpdates / static_cast<double>(holes);
  HoleFinder finder(map, jump);
  GeodesicVoronoiLabels territories(finder, roots, jump);
  HoleRegion region;
  std::vector<int> rim_of;
  std::vector<double> disparity;
  while (finder.Next(&region)) {
    if (region.planes.size() == 1 && HasPlane(region, region.rim.front(), jump)) {
      rim_of.assign(region.pixels.size(), 0);
      disparity.clear();
      for (const int pixel : region.pixels) {
        disparity.push_back(SurfaceAt(finder, region, region.rim.front(), pixel, jump));
      }
    } else {
      territories.Find(region, &rim_of, &disparity);
    }
    for (double& value : disparity) value = std::clamp(value, range.low, range.high);
    SurfaceRelaxation(finder, region, jump, most_sweeps).Solve(rim_of, &disparity);
    for (std::size_t i = 0; i < region.pixels.size(); ++i) {
      full->disparity[Index(region.pixels[i])] =
          static_cast<float>(std::clamp(disparity[i], range.low, range.high));
    }
  }
}

}  // namespace

DisparityMap FillHoles(const DisparityMap& map, const model::LinearImage& image,
                       std::size_t* filled, double at_infinity) {
  CheckSizes(map, image);
  DisparityMap full = map;
  const auto holes = static_cast<std::size_t>(std::count_if(
      map.disparity.begin(), map.disparity.end(), [](float value) { return std::isnan(value); }));
  if (filled != nullptr) *filled = holes;
  if (holes == map.disparity.size()) {
    throw Error(
        fmt::format("disparity map: all of its {} values are holes: at least one must be a "
                    "disparity, from which they can be filled",
                    holes));
  }
  if (holes > 0) Fill(map, image, holes, at_infinity, &full);
  return full;
}

}  // namespace thicklens::estimator
