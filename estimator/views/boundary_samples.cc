#include "estimator/views/boundary_samples.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "estimator/views/surface_taps.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"

namespace thicklens::estimator {
namespace {

// Minimum share of a sample's pixel. A smaller share counts as none, and a share that leaves less
// than this counts as the whole pixel.
constexpr float kMinShare = 0.01F;

struct Step {
  int x, y;
};
// Neighbours that share a side with the sample are before those that share a corner.
constexpr std::array<Step, 8> kAround{
    {{-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-1, -1}, {1, -1}, {-1, 1}, {1, 1}}};

struct Candidate {
  kernels::BoundarySample boundary;
  // True: the visible share of an occluded sample's own surface.
  bool is_same_surface = false;
};

class Mixer {
 public:
  Mixer(const DisparityMap& map, const CompactView& view)
      : map_(map),
        view_(view),
        tolerance_(static_cast<float>(SurfaceTolerance(map))),
        far_px_(static_cast<float>(map.width_px) + static_cast<float>(map.height_px)),
        is_done_(view.disparity.size(), 0) {}

  // Returns how the sample's pixel is mixed when a pixel at a jump, of the disparity `landing`,
  // lands in it. The background of a sample is returned only once.
  std::optional<Candidate> At(int x, int y, float landing) {
    if (!IsInside(x, y)) return std::nullopt;
    const bool is_occluded = std::isnan(view_.disparity[At(x, y)]);
    const float shown =
        is_occluded ? view_.OccludedAt(At(x, y)).disparity : view_.disparity[At(x, y)];
    if (landing < shown - tolerance_) return std::nullopt;
    const bool is_same_surface = landing <= shown + tolerance_;
    if (is_occluded || !is_same_surface) {
      const kernels::OccludedSample landed = On(x, y, landing);
      return Boundary(x, y, landed, Cover(x, y, landed), is_same_surface);
    }
    // The background does not depend on which pixel lands.
    if (std::exchange(is_done_[At(x, y)], 1) != 0) return std::nullopt;
    const float cover = Cover(x, y, On(x, y, shown));
    if (cover > 1 - kMinShare) return std::nullopt;
    const std::optional<kernels::OccludedSample> behind = Behind(x, y, shown);
    return behind ? Boundary(x, y, *behind, 1 - cover, false) : std::nullopt;
  }

 private:
  bool IsInside(int x, int y) const {
    return x >= 0 && y >= 0 && x < view_.width_px && y < view_.height_px;
  }
  std::size_t At(int x, int y) const { return Index(y) * Index(view_.width_px) + Index(x); }

  // Returns the share of a sample's pixel that the surface at `from` covers: each of the centre
  // view's pixels is a square, and so is the sample's pixel.
  float Cover(int x, int y, const kernels::OccludedSample& from) const {
    if (!(std::abs(from.source_x) < far_px_ && std::abs(from.source_y) < far_px_)) return 0;
    // The displacement is split into whole steps and the rest, so that all rows and columns round
    // alike.
    const float left = std::floor(from.source_x), above = std::floor(from.source_y);
    const float right_share = from.source_x - left, below_share = from.source_y - above;
    const int column = x + static_cast<int>(left), row = y + static_cast<int>(above);
    const auto share_in_row = [&](int of_row) {
      const float* const pixels =
          map_.disparity.data() +
          Index(std::clamp(of_row, 0, map_.height_px - 1)) * Index(map_.width_px);
      const auto is_on = [&](int of_column) {
        const float there = pixels[std::clamp(of_column, 0, map_.width_px - 1)];
        return std::abs(there - from.disparity) <= tolerance_ ? 1.0F : 0.0F;
      };
      return (1 - right_share) * is_on(column) + right_share * is_on(column + 1);
    };
    return (1 - below_share) * share_in_row(row) + below_share * share_in_row(row + 1);
  }

  // Returns the source of a sample on a surface of that disparity.
  kernels::OccludedSample On(int x, int y, float disparity) const {
    return {static_cast<std::int32_t>(At(x, y)), static_cast<float>(view_.shift.x() * disparity),
            static_cast<float>(view_.shift.y() * disparity), disparity};
  }

  // Returns the surface that the neighbouring samples show beyond a surface; visible samples
  // precede hidden ones. Where the centre view does not show that surface here, the neighbour's own
  // source is returned.
  std::optional<kernels::OccludedSample> Behind(int x, int y, float disparity) const {
    std::optional<kernels::OccludedSample> beside, occluded;
    for (const Step& step : kAround) {
      const int other_x = x + step.x, other_y = y + step.y;
      if (!IsInside(other_x, other_y)) continue;
      const std::size_t there = At(other_x, other_y);
      const bool is_occluded = std::isnan(view_.disparity[there]);
      kernels::OccludedSample other =
          is_occluded ? view_.OccludedAt(there) : On(x, y, view_.disparity[there]);
      if (!(other.disparity < disparity - tolerance_)) continue;
      const bool is_shown = Cover(x, y, other) >= kMinShare;
      if (is_shown && !is_occluded) return other;
      std::optional<kernels::OccludedSample>& kept = is_occluded ? occluded : beside;
      if (kept) continue;
      if (!is_shown) {
        other.source_x += static_cast<float>(step.x);
        other.source_y += static_cast<float>(step.y);
      }
      kept = other;
    }
    return beside ? beside : occluded;
  }

  std::optional<Candidate> Boundary(int x, int y, const kernels::OccludedSample& other, float share,
                                    bool is_same_surface) const {
    if (share < kMinShare) return std::nullopt;
    return Candidate{{static_cast<std::int32_t>(At(x, y)), other, share}, is_same_surface};
  }

  const DisparityMap& map_;
  const CompactView& view_;
  const float tolerance_;
  const float far_px_;
  std::vector<unsigned char> is_done_;  // 1: the sample's background was returned
};

// Orders the candidates of one sample: another surface before the sample's own, then the larger
// share, then the nearer surface.
bool IsBefore(const Candidate& a, const Candidate& b) {
  const auto key = [](const Candidate& candidate) {
    return std::tuple(candidate.is_same_surface, -candidate.boundary.share,
                      -candidate.boundary.other.disparity);
  };
  return key(a) < key(b);
}

// Collects the first candidate (by IsBefore) of each sample.
class FirstCandidates {
 public:
  explicit FirstCandidates(std::size_t samples) : place_(samples, kNone) {}

  void Add(const Candidate& candidate) {
    std::int32_t& place = place_[Index(candidate.boundary.index)];
    if (place == kNone) {
      place = static_cast<std::int32_t>(candidates_.size());
      candidates_.push_back(candidate);
    } else if (IsBefore(candidate, candidates_[Index(place)])) {
      candidates_[Index(place)] = candidate;
    }
  }

  std::vector<kernels::BoundarySample> ByIndex() const {
    std::vector<kernels::BoundarySample> boundary;
    boundary.reserve(candidates_.size());
    for (const std::int32_t place : place_) {
      if (place != kNone) boundary.push_back(candidates_[Index(place)].boundary);
    }
    return boundary;
  }

 private:
  static constexpr std::int32_t kNone = -1;

  std::vector<std::int32_t> place_;  // index of each sample's candidate in candidates_
  std::vector<Candidate> candidates_;
};

}  // namespace

std::vector<kernels::BoundarySample> FindBoundarySamples(const DisparityMap& map,
                                                         const std::vector<int>& at_jump,
                                                         const CompactView& view) {
  if (at_jump.empty()) return {};
  Mixer mixer(map, view);
  const std::size_t width = Index(map.width_px);
  FirstCandidates candidates(view.disparity.size());
  for (const int index : at_jump) {
    ThrowIfCancelled();
    const std::size_t i = Index(index);
    const float disparity = map.disparity[i];
    const double x = static_cast<double>(i % width) - view.shift.x() * disparity;
    const double y = static_cast<double>(i / width) - view.shift.y() * disparity;
    if (!(x > -1 && y > -1 && x < map.width_px && y < map.height_px)) continue;
    const int left = static_cast<int>(std::floor(x)), above = static_cast<int>(std::floor(y));
    for (const Step& step : {Step{0, 0}, Step{1, 0}, Step{0, 1}, Step{1, 1}}) {
      const auto candidate = mixer.At(left + step.x, above + step.y, disparity);
      if (candidate) candidates.Add(*candidate);
    }
  }
  return candidates.ByIndex();
}

}  // namespace thicklens::estimator
