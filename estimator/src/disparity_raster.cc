// RenderDisparity: a disparity map drawn into another view.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

#include "thicklens/error.h"
#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {
namespace {

// Neighbours whose disparities differ by more, px per view step, belong to two surfaces.
constexpr double kSameSurfacePx = 0.2;

// How far beside a shape, px, a sample still belongs to it: more than the rounding of disparities
// in float, so that samples on a common edge or on the outer border are not lost.
constexpr double kEdgeTolerancePx = 1e-5;

// A triangle with less than this, twice its area, is seen edge-on: a line.
constexpr double kEdgeOnPx2 = 1e-9;

constexpr float kUncovered = -std::numeric_limits<float>::infinity();

std::size_t Index(int i) { return static_cast<std::size_t>(i); }

// A pixel of the centre view where it stands in the other view.
struct Vertex {
  double x = 0, y = 0;
  double disparity = 0;
};

// Twice the signed area of the triangle p, q, (x, y).
double Edge(const Vertex& p, const Vertex& q, double x, double y) {
  return (p.x - x) * (q.y - y) - (q.x - x) * (p.y - y);
}

// The integers in [from, to] and in [0, count - 1]; `last` < `first` if there are none.
struct Samples {
  int first = 0, last = -1;
};
// Cut before the conversion: a point may be anywhere. Numbers are then not negative, where the
// conversion is floor.
Samples SamplesBetween(double from, double to, int count) {
  const double low = std::clamp(from - kEdgeTolerancePx, 0.0, static_cast<double>(count));
  const double above_high = std::clamp(to + kEdgeTolerancePx, -1.0, count - 1.0) + 1;
  const int below = static_cast<int>(low);
  return {below < low ? below + 1 : below, static_cast<int>(above_high) - 1};
}

// The nearest surface at each sample of a view.
class DisparityBuffer {
 public:
  DisparityBuffer(int width_px, int height_px)
      : width_px_(width_px),
        height_px_(height_px),
        disparity_(Index(width_px) * Index(height_px), kUncovered) {}

  // Interpolated linearly. Both sides of a triangle are drawn: the back of a surface is hidden by
  // its front.
  void DrawTriangle(const Vertex& p, const Vertex& q, const Vertex& r) {
    const Samples rows =
        SamplesBetween(std::min({p.y, q.y, r.y}), std::max({p.y, q.y, r.y}), height_px_);
    const Samples columns =
        SamplesBetween(std::min({p.x, q.x, r.x}), std::max({p.x, q.x, r.x}), width_px_);
    if (rows.first > rows.last || columns.first > columns.last) return;
    const double area = Edge(p, q, r.x, r.y);
    if (!(std::abs(area) > kEdgeOnPx2)) return;
    const double sign = area > 0 ? 1 : -1;
    for (int y = rows.first; y <= rows.last; ++y) {
      for (int x = columns.first; x <= columns.last; ++x) {
        double share_p = sign * Edge(q, r, x, y);
        double share_q = sign * Edge(r, p, x, y);
        double share_r = sign * Edge(p, q, x, y);
        if (std::min({share_p, share_q, share_r}) < -kEdgeTolerancePx) continue;
        // Never extrapolated, however thin the triangle.
        share_p = std::max(share_p, 0.0);
        share_q = std::max(share_q, 0.0);
        share_r = std::max(share_r, 0.0);
        Put(x, y,
            (share_p * p.disparity + share_q * q.disparity + share_r * r.disparity) /
                (share_p + share_q + share_r));
      }
    }
  }

  void DrawSquare(const Vertex& centre) {
    const Samples rows = SamplesBetween(centre.y - 0.5, centre.y + 0.5, height_px_);
    const Samples columns = SamplesBetween(centre.x - 0.5, centre.x + 0.5, width_px_);
    for (int y = rows.first; y <= rows.last; ++y) {
      for (int x = columns.first; x <= columns.last; ++x) Put(x, y, centre.disparity);
    }
  }

  bool IsCovered(int x, int y) const { return at(x, y) != kUncovered; }
  bool IsInside(int x, int y) const { return x >= 0 && x < width_px_ && y >= 0 && y < height_px_; }
  float at(int x, int y) const { return disparity_[Index(y) * Index(width_px_) + Index(x)]; }
  int width_px() const { return width_px_; }
  int height_px() const { return height_px_; }

 private:
  void Put(int x, int y, double disparity) {
    float& there = disparity_[Index(y) * Index(width_px_) + Index(x)];
    there = std::max(there, static_cast<float>(disparity));
  }

  int width_px_;
  int height_px_;
  std::vector<float> disparity_;
};

// Draws the map as it stands in the view that moves a point by -disparity * shift.
class MapPainter {
 public:
  MapPainter(const DisparityMap& map, const Eigen::Vector2d& shift, DisparityBuffer* buffer)
      : map_(map),
        shift_(shift),
        px_per_unit_(map.step.cwiseAbs().maxCoeff()),
        buffer_(buffer),
        alone_(map.disparity.size(), map.width_px == 1 || map.height_px == 1) {}

  void Paint() {
    std::vector<Vertex> upper = RowOfVertices(0);
    for (int y = 1; y < map_.height_px; ++y) {
      std::vector<Vertex> lower = RowOfVertices(y);
      PaintCells(upper, lower, y - 1);
      upper.swap(lower);
    }
    for (int y = 0; y < map_.height_px; ++y) {
      for (int x = 0; x < map_.width_px; ++x) {
        if (alone_[IndexOf(x, y)]) buffer_->DrawSquare(VertexAt(x, y));
      }
    }
  }

 private:
  std::size_t IndexOf(int x, int y) const { return Index(y) * Index(map_.width_px) + Index(x); }

  Vertex VertexAt(int x, int y) const {
    const double disparity = map_.disparity[IndexOf(x, y)];
    return {x - shift_.x() * disparity, y - shift_.y() * disparity, disparity};
  }

  std::vector<Vertex> RowOfVertices(int y) const {
    std::vector<Vertex> row;
    row.reserve(Index(map_.width_px));
    for (int x = 0; x < map_.width_px; ++x) row.push_back(VertexAt(x, y));
    return row;
  }

  // The cells between two rows of pixels, the upper one being `y`.
  void PaintCells(const std::vector<Vertex>& upper, const std::vector<Vertex>& lower, int y) {
    for (int x = 0; x + 1 < map_.width_px; ++x) {
      const Vertex& p00 = upper[Index(x)];
      const Vertex& p10 = upper[Index(x + 1)];
      const Vertex& p01 = lower[Index(x)];
      const Vertex& p11 = lower[Index(x + 1)];
      const auto [low, high] =
          std::minmax({p00.disparity, p10.disparity, p01.disparity, p11.disparity});
      if ((high - low) * px_per_unit_ > kSameSurfacePx) {
        alone_[IndexOf(x, y)] = alone_[IndexOf(x + 1, y)] = true;
        alone_[IndexOf(x, y + 1)] = alone_[IndexOf(x + 1, y + 1)] = true;
        continue;
      }
      buffer_->DrawTriangle(p00, p10, p11);
      buffer_->DrawTriangle(p00, p11, p01);
    }
  }

  const DisparityMap& map_;
  const Eigen::Vector2d shift_;
  const double px_per_unit_;
  DisparityBuffer* buffer_;
  std::vector<char> alone_;  // pixels that are drawn as squares
};

// The samples that nothing covers: each takes over a covered one.
class HoleFiller {
 public:
  struct Sample {
    int x = 0, y = 0;
  };

  // `direction`: of the displacement between views, not (0, 0).
  HoleFiller(const DisparityBuffer& buffer, const Eigen::Vector2d& direction)
      : buffer_(buffer), direction_(direction / direction.cwiseAbs().maxCoeff()) {}

  // The farther of the first covered samples on both sides along the direction; of two equally far
  // ones the closer. Where there is none, the covered sample closest by steps along rows and
  // columns. None if no sample of the view is covered.
  std::optional<Sample> Background(int x, int y) {
    const std::optional<Found> ahead = Walk(x, y, 1);
    const std::optional<Found> back = Walk(x, y, -1);
    if (!ahead && !back) return Closest(x, y);
    if (!ahead) return back->sample;
    if (!back) return ahead->sample;
    const float ahead_disparity = buffer_.at(ahead->sample.x, ahead->sample.y);
    const float back_disparity = buffer_.at(back->sample.x, back->sample.y);
    if (ahead_disparity == back_disparity) {
      return ahead->steps <= back->steps ? ahead->sample : back->sample;
    }
    return ahead_disparity < back_disparity ? ahead->sample : back->sample;
  }

 private:
  struct Found {
    Sample sample;
    int steps = 0;
  };

  std::optional<Found> Walk(int x, int y, int sense) const {
    for (int steps = 1;; ++steps) {
      const Sample at{static_cast<int>(std::floor(x + sense * steps * direction_.x() + 0.5)),
                      static_cast<int>(std::floor(y + sense * steps * direction_.y() + 0.5))};
      if (!buffer_.IsInside(at.x, at.y)) return std::nullopt;
      if (buffer_.IsCovered(at.x, at.y)) return Found{at, steps};
    }
  }

  std::optional<Sample> Closest(int x, int y) {
    if (closest_.empty()) SpreadCovered();
    const int origin = closest_[IndexOf(x, y)];
    if (origin < 0) return std::nullopt;
    return Sample{origin % buffer_.width_px(), origin / buffer_.width_px()};
  }

  // Breadth first from all covered samples at once.
  void SpreadCovered() {
    closest_.assign(Index(buffer_.width_px()) * Index(buffer_.height_px()), -1);
    std::vector<Sample> queue;
    queue.reserve(closest_.size());
    for (int y = 0; y < buffer_.height_px(); ++y) {
      for (int x = 0; x < buffer_.width_px(); ++x) {
        if (!buffer_.IsCovered(x, y)) continue;
        closest_[IndexOf(x, y)] = static_cast<int>(IndexOf(x, y));
        queue.push_back({x, y});
      }
    }
    for (std::size_t i = 0; i < queue.size(); ++i) {
      const Sample from = queue[i];
      for (const Sample to : {Sample{from.x + 1, from.y}, Sample{from.x - 1, from.y},
                              Sample{from.x, from.y + 1}, Sample{from.x, from.y - 1}}) {
        if (!buffer_.IsInside(to.x, to.y) || closest_[IndexOf(to.x, to.y)] >= 0) continue;
        closest_[IndexOf(to.x, to.y)] = closest_[IndexOf(from.x, from.y)];
        queue.push_back(to);
      }
    }
  }

  std::size_t IndexOf(int x, int y) const {
    return Index(y) * Index(buffer_.width_px()) + Index(x);
  }

  const DisparityBuffer& buffer_;
  const Eigen::Vector2d direction_;
  std::vector<int> closest_;  // index of a covered sample for each; empty until it is needed
};

void CheckMap(const DisparityMap& map) {
  if (map.width_px < 1 || map.height_px < 1 ||
      map.disparity.size() != Index(map.width_px) * Index(map.height_px)) {
    throw Error(
        fmt::format("disparity map: {} values for {}x{} px: the count must be the product, "
                    "and not 0",
                    map.disparity.size(), map.width_px, map.height_px));
  }
  if (!std::all_of(map.disparity.begin(), map.disparity.end(),
                   [](float d) { return std::isfinite(d); })) {
    throw Error("disparity map: it has holes: they must be filled before a view is rendered");
  }
}

}  // namespace

ViewDisparity RenderDisparity(const DisparityMap& map, double a, double b) {
  CheckMap(map);
  const Eigen::Vector2d shift(a * map.step.x(), b * map.step.y());
  if (!shift.allFinite()) {
    throw Error(fmt::format("view ({}, {}) steps from the centre: both must be finite", a, b));
  }
  ViewDisparity view;
  view.width_px = map.width_px;
  view.height_px = map.height_px;
  view.disparity = map.disparity;
  view.seen.assign(map.disparity.size(), Seen::kSeen);
  view.source_x.assign(map.disparity.size(), 0.0F);
  view.source_y.assign(map.disparity.size(), 0.0F);
  if (shift.isZero(0)) return view;

  DisparityBuffer buffer(map.width_px, map.height_px);
  MapPainter(map, shift, &buffer).Paint();
  HoleFiller filler(buffer, shift);
  for (int y = 0; y < map.height_px; ++y) {
    for (int x = 0; x < map.width_px; ++x) {
      const std::size_t i = Index(y) * Index(map.width_px) + Index(x);
      HoleFiller::Sample shown{x, y};
      if (!buffer.IsCovered(x, y)) {
        view.seen[i] = Seen::kHidden;
        const std::optional<HoleFiller::Sample> background = filler.Background(x, y);
        if (!background) continue;  // the view looks past the picture: the centre stands in
        shown = *background;
      }
      const double disparity = buffer.at(shown.x, shown.y);
      view.disparity[i] = static_cast<float>(disparity);
      view.source_x[i] = static_cast<float>(shown.x - x + shift.x() * disparity);
      view.source_y[i] = static_cast<float>(shown.y - y + shift.y() * disparity);
    }
  }
  return view;
}

}  // namespace thicklens::estimator
