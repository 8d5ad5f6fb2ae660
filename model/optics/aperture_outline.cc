#include "thicklens/model/aperture_outline.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "thicklens/base/error.h"
#include "thicklens/base/pi.h"
#include "thicklens/base/validity.h"

namespace thicklens::model {
namespace {

constexpr int kMinBlades = 3, kMaxBlades = 30;
// Chords of a whole circle: its area falls short by (2 pi/n)^2/6, 5e-4.
constexpr int kChords = 120;
constexpr double kSmallPhase = 1e-4;  // below it a polygon's transform is its series

double Cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

// Distance of the outline from the middle in a direction, in radii of the circle about the corners.
double RadiusAt(const ApertureOutline& outline, double angle_rad) {
  if (outline.blades == 0) return 1;
  const double sector = 2 * kPi / outline.blades;
  const double turned = angle_rad - outline.rotation_deg * kPi / 180;
  const double from_middle = turned - sector * (std::floor(turned / sector) + 0.5);
  const double straight = std::cos(sector / 2) / std::cos(from_middle);
  return straight + outline.roundness * (1 - straight);
}

}  // namespace

bool ApertureOutline::IsValid(std::string* why) const {
  if (blades != 0 && !(blades >= kMinBlades && blades <= kMaxBlades)) {
    return Fail(why, fmt::format("aperture.blades is {}: it must be from {} to {}, or 0 for a "
                                 "round aperture",
                                 blades, kMinBlades, kMaxBlades));
  }
  if (!std::isfinite(rotation_deg))
    return Fail(why, fmt::format("aperture.rotation_deg is {}: it must be finite", rotation_deg));
  if (!(roundness >= 0 && roundness <= 1))
    return Fail(why, fmt::format("aperture.roundness is {}: it must be from 0 to 1", roundness));
  return true;
}

std::vector<Eigen::Vector2d> ApertureOutline::Corners() const {
  std::vector<Eigen::Vector2d> corners;
  const bool is_straight = blades > 0 && roundness == 0;
  const int sides = std::max(1, blades);
  const int per_side = is_straight ? 1 : (kChords + sides - 1) / sides;
  for (int i = 0; i < sides * per_side; ++i) {
    const double angle = rotation_deg * kPi / 180 + 2 * kPi * i / (sides * per_side);
    // At a corner of two blades the distance is 1, whatever rounding does to the angle.
    const double radius = i % per_side == 0 ? 1 : RadiusAt(*this, angle);
    corners.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  return corners;
}

double PolygonMoments::Sigma() const { return std::sqrt(second.trace() / 2); }

// By Green's theorem, from the triangles of the origin and each side.
PolygonMoments MomentsOf(const std::vector<Eigen::Vector2d>& corners) {
  if (corners.size() < 3)
    throw Error(fmt::format("polygon: at least 3 corners are expected, found {}", corners.size()));
  PolygonMoments moments;
  Eigen::Vector2d first(0, 0);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d &a = corners[i], &b = corners[(i + 1) % corners.size()];
    const double twice = Cross(a, b);
    const Eigen::Vector2d sum = a + b;
    moments.area += twice / 2;
    first += twice / 6 * sum;
    moments.second += twice / 24 * (a * a.transpose() + b * b.transpose() + sum * sum.transpose());
  }
  moments.centroid = first / moments.area;
  moments.second = moments.second / moments.area - moments.centroid * moments.centroid.transpose();
  return moments;
}

// [D177] By the theorem of Gauss the integral of exp(-i q.x), q = 2 pi f, is the sum over the sides
// from a to b of i (q x (b - a))/|q|^2 exp(-i q.(a + b)/2) sinc(q.(b - a)/2), sinc t = sin t/t and
// x the cross product. Near q = 0 its terms cancel, and the series up to the second moments is
// used: exp(-i q.m) (1 - q.C q/2), m the centroid, C the second moments.
std::complex<double> PolygonTransfer(const std::vector<Eigen::Vector2d>& corners,
                                     const PolygonMoments& moments, const Eigen::Vector2d& f) {
  const Eigen::Vector2d q = 2 * kPi * f;
  const double spread = q.dot(moments.second * q);
  if (spread < kSmallPhase * kSmallPhase)
    return (1 - spread / 2) * std::polar(1.0, -q.dot(moments.centroid));
  std::complex<double> sum = 0;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector2d &a = corners[i], &b = corners[(i + 1) % corners.size()];
    const double half = q.dot(b - a) / 2;
    const double sinc = std::abs(half) < 1e-8 ? 1 : std::sin(half) / half;
    sum += std::complex<double>(0, Cross(q, b - a)) * (sinc * std::polar(1.0, -q.dot(a + b) / 2));
  }
  return sum / (q.squaredNorm() * moments.area);
}

}  // namespace thicklens::model
