#include "thicklens/model/lens_aberrations.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "thicklens/base/validity.h"

namespace thicklens::model {
namespace {

// r (1 + d r^2) = 1 has a solution for d >= -4/27: the barrel shows the farthest corner.
constexpr double kMinDistortion = -0.14, kMaxDistortion = 0.3;
constexpr int kNewtonSteps = 30;

// h with 1/(u + h) - 1/(u - h) = difference_mm, u = 1/depth_mm: half of the distance in 1/z of two
// foci about their mean.
double HalfSeparation(double difference_mm, double depth_mm) {
  if (difference_mm == 0) return 0;
  const double u = 1 / depth_mm, du = difference_mm * u;
  // (1 - sqrt(1 + du^2))/difference without the cancellation of small differences.
  return -du * u / (1 + std::sqrt(1 + du * du));
}

}  // namespace

double FarthestCornerPx(const Sensor& sensor) {
  const Eigen::Vector2d& axis_px = sensor.principal_point_px;
  return Eigen::Vector2d(std::max(axis_px.x(), sensor.width_px - 1 - axis_px.x()),
                         std::max(axis_px.y(), sensor.height_px - 1 - axis_px.y()))
      .norm();
}

bool LensAberrations::IsValid(const ThickLens& lens, double focus_depth_mm,
                              std::string* why) const {
  for (const auto& [name, value_mm] : {std::pair("field_curvature_mm", field_curvature_mm),
                                       std::pair("field_astigmatism_mm", field_astigmatism_mm),
                                       std::pair("astigmatism_mm", astigmatism_mm)}) {
    if (!std::isfinite(value_mm))
      return Fail(why, fmt::format("aberrations.{} is {}: it must be finite", name, value_mm));
  }
  if (!(distortion >= kMinDistortion && distortion <= kMaxDistortion)) {
    return Fail(why, fmt::format("aberrations.distortion is {}: it must be from {} to {}",
                                 distortion, kMinDistortion, kMaxDistortion));
  }
  if (axial_colour_mm && !axial_colour_mm->allFinite())
    return Fail(why, "aberrations.axial_colour_mm has a number that is not finite");
  const bool displaces_colours = axial_colour_mm && !axial_colour_mm->isZero(0);
  if (!DisplaceFocus() && !displaces_colours) return true;
  const double f1_mm = lens.front_focal_length_mm;
  if (!std::isfinite(focus_depth_mm)) {
    return Fail(why,
                "aberrations: the plane of focus is at infinity: millimetres of depth do not "
                "describe its displacement");
  }
  for (const double medial_mm : {focus_depth_mm, focus_depth_mm + field_curvature_mm}) {
    const double apart_mm = 0.5 * (std::abs(field_astigmatism_mm) + std::abs(astigmatism_mm)) +
                            (displaces_colours ? std::max(0.0, -axial_colour_mm->minCoeff()) : 0);
    if (!(medial_mm - apart_mm > f1_mm)) {
      return Fail(why, fmt::format("aberrations: a part of the field would be in focus at {:g} mm: "
                                   "it must be beyond the front focal length {:g} mm",
                                   medial_mm - apart_mm, f1_mm));
    }
  }
  return true;
}

Eigen::Matrix2d FocusDisplacement(const LensAberrations& aberrations, double focus_depth_mm,
                                  const Eigen::Vector2d& from_axis_px, double farthest_corner_px) {
  const double rho2 = from_axis_px.squaredNorm() / std::pow(std::max(1.0, farthest_corner_px), 2);
  const double medial_mm = focus_depth_mm + aberrations.field_curvature_mm * rho2;
  Eigen::Matrix2d displacement = (1 / medial_mm - 1 / focus_depth_mm) * Eigen::Matrix2d::Identity();
  const double by_axis = HalfSeparation(aberrations.astigmatism_mm, medial_mm);
  displacement += Eigen::Vector2d(by_axis, -by_axis).asDiagonal();
  if (rho2 > 0) {
    const double by_field = HalfSeparation(aberrations.field_astigmatism_mm * rho2, medial_mm);
    const Eigen::Vector2d radial = from_axis_px.normalized();
    displacement += by_field * (Eigen::Matrix2d::Identity() - 2 * radial * radial.transpose());
  }
  return displacement;
}

double ColourDisplacement(const LensAberrations& aberrations, double focus_depth_mm, int colour) {
  if (!aberrations.axial_colour_mm || (*aberrations.axial_colour_mm)[colour] == 0) return 0;
  return 1 / (focus_depth_mm + (*aberrations.axial_colour_mm)[colour]) - 1 / focus_depth_mm;
}

Eigen::Vector2d WithoutDistortion(double distortion, const Eigen::Vector2d& from_axis_px,
                                  double farthest_corner_px) {
  const double seen = from_axis_px.norm() / std::max(1.0, farthest_corner_px);
  if (distortion == 0 || seen == 0) return from_axis_px;
  // Newton's method for r (1 + distortion r^2) = seen.
  double r = seen;
  for (int i = 0; i < kNewtonSteps; ++i) {
    const double slope = std::max(0.05, 1 + 3 * distortion * r * r);
    const double step = (r * (1 + distortion * r * r) - seen) / slope;
    r -= step;
    if (std::abs(step) < 1e-14) break;
  }
  return from_axis_px * (r / seen);
}

}  // namespace thicklens::model
