#include "estimator/views/disparity_buffer.h"

#include <algorithm>
#include <cmath>

#include "thicklens/kernels/cell_row.h"

namespace thicklens::estimator {
namespace {

// A triangle is seen edge-on, as a line, if twice its area is less than this.
constexpr double kEdgeOnPx2 = 1e-9;

constexpr double kTolerancePx = kernels::kEdgeTolerancePx;

// Twice the signed area of the triangle p, q, (x, y).
double Edge(const Vertex& p, const Vertex& q, double x, double y) {
  return (p.x - x) * (q.y - y) - (q.x - x) * (p.y - y);
}

// The integers in both [from, to] and [0, count - 1]; `last` < `first` if there are none.
struct Samples {
  int first = 0, last = -1;
};
// Bounds are clamped before the conversion because a point may be anywhere. The clamped numbers are
// not negative, so that the conversion to int is floor.
Samples SamplesBetween(double from, double to, int count) {
  const double low = std::clamp(from - kTolerancePx, 0.0, static_cast<double>(count));
  const double above_high = std::clamp(to + kTolerancePx, -1.0, count - 1.0) + 1;
  const int below = static_cast<int>(low);
  return {below < low ? below + 1 : below, static_cast<int>(above_high) - 1};
}

}  // namespace

void DisparityBuffer::DrawTriangle(const Vertex& p, const Vertex& q, const Vertex& r) {
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
      if (std::min({share_p, share_q, share_r}) < -kTolerancePx) continue;
      // Extrapolation is excluded, however thin the triangle is.
      share_p = std::max(share_p, 0.0);
      share_q = std::max(share_q, 0.0);
      share_r = std::max(share_r, 0.0);
      const double disparity =
          (share_p * p.disparity + share_q * q.disparity + share_r * r.disparity) /
          (share_p + share_q + share_r);
      Put(x, y, static_cast<float>(disparity));
    }
  }
}

void DisparityBuffer::DrawSquare(const Vertex& centre) {
  const Samples rows = SamplesBetween(centre.y - 0.5, centre.y + 0.5, height_px_);
  const Samples columns = SamplesBetween(centre.x - 0.5, centre.x + 0.5, width_px_);
  for (int y = rows.first; y <= rows.last; ++y) {
    for (int x = columns.first; x <= columns.last; ++x) {
      Put(x, y, static_cast<float>(centre.disparity));
    }
  }
}

}  // namespace thicklens::estimator
