#include "model/simulate/scene/height_field.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace thicklens::model {
namespace {

// Number of narrowings; more would gain less than the width of the blocks of the bounds.
constexpr int kNarrowings = 3;

std::vector<double> ShiftsOf(const std::vector<float>& depth_mm, double scale_px,
                             double inverse_focus_per_mm) {
  std::vector<double> shifts;
  shifts.reserve(depth_mm.size());
  for (const float z_mm : depth_mm) {
    shifts.push_back(scale_px * (1 / static_cast<double>(z_mm) - inverse_focus_per_mm));
  }
  return shifts;
}

// The surface between four pixels, as a function of the position between them: V = corner + right
// fx + down fy + twist fx fy.
struct Cell {
  double corner, right, down, twist;

  double At(double fx, double fy) const { return corner + right * fx + (down + twist * fx) * fy; }
};

// Steps along one axis from cell to cell.
struct CellSteps {
  CellSteps(double from_px, double px_per_step)
      : cell(static_cast<int>(std::floor(from_px))),
        direction(px_per_step < 0 ? -1 : 1),
        between(px_per_step == 0 ? std::numeric_limits<double>::infinity()
                                 : 1 / std::abs(px_per_step)),
        next(px_per_step == 0 ? between
                              : (px_per_step < 0 ? from_px - cell : cell + 1 - from_px) * between) {
  }

  void Advance() {
    cell += direction;
    next += between;
  }

  int cell;
  const int direction;
  const double between;  // distance from border to border along the ray
  double next;           // distance from the start to the next border
};

}  // namespace

HeightField::HeightField(int width_px, int height_px, const std::vector<float>& depth_mm,
                         double scale_px, double focus_depth_mm)
    : width_px_(width_px),
      height_px_(height_px),
      scale_px_(scale_px),
      inverse_focus_per_mm_(1 / focus_depth_mm),
      shift_(ShiftsOf(depth_mm, scale_px, inverse_focus_per_mm_)),
      shifts_(width_px, height_px, [this](int x, int y) { return At(x, y); }),
      slopes_(width_px, height_px,
              [this](int x, int y) {
                return std::max(std::abs(At(x + 1, y) - At(x, y)),
                                std::abs(At(x, y + 1) - At(x, y)));
              }),
      bends_(width_px, height_px,
             [this](int x, int y) {
               const double here = At(x, y), right = At(x + 1, y), down = At(x, y + 1);
               return std::max({std::abs(right - 2 * here + At(x - 1, y)),
                                std::abs(down - 2 * here + At(x, y - 1)),
                                std::abs(At(x + 1, y + 1) - right - down + here)});
             }),
      all_(ShiftsOver({{0, 0}, {width_px - 1.0, height_px - 1.0}})) {}

double HeightField::At(int x, int y) const {
  return shift_[static_cast<std::size_t>(std::clamp(y, 0, height_px_ - 1)) *
                    static_cast<std::size_t>(width_px_) +
                static_cast<std::size_t>(std::clamp(x, 0, width_px_ - 1))];
}

HeightField::Corners HeightField::CornersOf(int x, int y) const {
  if (x >= 0 && x < width_px_ - 1 && y >= 0 && y < height_px_ - 1) {
    const double* above =
        &shift_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px_) +
                static_cast<std::size_t>(x)];
    return {above[0], above[1], above[width_px_], above[width_px_ + 1]};
  }
  return {At(x, y), At(x + 1, y), At(x, y + 1), At(x + 1, y + 1)};
}

double HeightField::ShiftAt(const Eigen::Vector2d& position_px) const {
  const double x_px = std::clamp(position_px.x(), 0.0, width_px_ - 1.0);
  const double y_px = std::clamp(position_px.y(), 0.0, height_px_ - 1.0);
  const int x = static_cast<int>(x_px), y = static_cast<int>(y_px);
  const Corners of = CornersOf(x, y);
  const double above = of.upper_left + (x_px - x) * (of.upper_right - of.upper_left);
  const double below = of.lower_left + (x_px - x) * (of.lower_right - of.lower_left);
  return above + (y_px - y) * (below - above);
}

double HeightField::SteepestOver(const ImageRegion& region) const {
  return std::sqrt(2.0) * slopes_.Over(region).high;
}

ImageRegion HeightField::ReachedRegion(const ImageRegion& region, const ApertureBox& aperture,
                                       const ValueRange& shifts) {
  const Eigen::Array2d ends_px[] = {shifts.low * aperture.low_mm, shifts.low * aperture.high_mm,
                                    shifts.high * aperture.low_mm, shifts.high * aperture.high_mm};
  const Eigen::Array2d low_px = ends_px[0].min(ends_px[1]).min(ends_px[2].min(ends_px[3]));
  const Eigen::Array2d high_px = ends_px[0].max(ends_px[1]).max(ends_px[2].max(ends_px[3]));
  return {region.low_px + low_px.matrix(), region.high_px + high_px.matrix()};
}

// If bounds of the shifts are known, they also bound the positions that the rays pass. Bounds of V
// over these positions are then narrower bounds of the shifts.
ValueRange HeightField::IntersectionShiftBounds(const ImageRegion& region,
                                                const ApertureBox& aperture) const {
  ValueRange met = all_;
  for (int i = 0; i < kNarrowings; ++i) met = ShiftsOver(ReachedRegion(region, aperture, met));
  return met;
}

// Let t be the distance from the start. Then h(t) = +-(V(x + A V(t)) - V(t)) >= 0 at the start. On
// a cell h = q0 + q1 t + q2 t^2 from its entry. The first zero is 2 q0/(-q1 + sqrt(q1^2 - 4 q2
// q0)); where that is not positive, it is behind the ray.
double HeightField::FirstIntersection(const Eigen::Vector2d& position_px,
                                      const Eigen::Vector2d& aperture_mm, double from,
                                      double to) const {
  const double sign = to < from ? -1 : 1;
  const double length = std::abs(to - from);
  const Eigen::Vector2d start_px = position_px + from * aperture_mm;
  const double dx = sign * aperture_mm.x(), dy = sign * aperture_mm.y();
  CellSteps columns(start_px.x(), dx), rows(start_px.y(), dy);
  double entry = 0;
  while (true) {
    const double exit = std::min({columns.next, rows.next, length});
    const auto [corner, right, down, across] = CornersOf(columns.cell, rows.cell);
    const double extreme = sign < 0 ? std::max(std::max(corner, right), std::max(down, across))
                                    : std::min(std::min(corner, right), std::min(down, across));
    // Otherwise the whole cell is beyond the shift at which the ray leaves it.
    if (!(sign * (extreme - from) > exit)) {
      const Cell cell{corner, right - corner, down - corner, across - right - down + corner};
      const double fx = start_px.x() + entry * dx - columns.cell;
      const double fy = start_px.y() + entry * dy - rows.cell;
      const double q0 = sign * (cell.At(fx, fy) - from) - entry;
      if (!(q0 > 0)) return from + sign * entry;
      const double q1 =
          sign * (cell.right * dx + cell.down * dy + cell.twist * (fx * dy + fy * dx)) - 1;
      const double q2 = sign * cell.twist * dx * dy;
      const double square = q1 * q1 - 4 * q2 * q0;
      if (square >= 0) {
        const double half = std::sqrt(square) - q1;
        if (half > 0 && 2 * q0 <= half * (exit - entry))
          return from + sign * (entry + 2 * q0 / half);
      }
    }
    if (exit >= length) return to;
    entry = exit;
    if (columns.next <= rows.next) {
      columns.Advance();
    } else {
      rows.Advance();
    }
  }
}

double HeightField::IntersectionNearShift(const Eigen::Vector2d& position_px,
                                          const Eigen::Vector2d& aperture_mm, double shift,
                                          const ValueRange& bounds) const {
  const bool is_before = ShiftAt(position_px + shift * aperture_mm) < shift;
  return FirstIntersection(position_px, aperture_mm, shift,
                           is_before ? std::min(bounds.low, shift) : std::max(bounds.high, shift));
}

}  // namespace thicklens::model
