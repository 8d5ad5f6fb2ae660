#include "thicklens/model/thick_lens.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "thicklens/base/error.h"
#include "thicklens/base/validity.h"

namespace thicklens::model {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// D = d1 - rho, mm, from the rear principal plane to the sensor.
double RearDistanceMm(const ThickLens& lens, double image_distance_mm) {
  const double rear_distance_mm = image_distance_mm - lens.lens_thickness_mm;
  if (!(rear_distance_mm > 0) || !std::isfinite(rear_distance_mm)) {
    throw Error(
        fmt::format("image_distance_mm is {}: it must be finite and above lens_thickness_mm, {}, "
                    "so that the sensor is behind the rear principal plane",
                    image_distance_mm, lens.lens_thickness_mm));
  }
  return rear_distance_mm;
}

// D - f2, mm; exactly 0 where the two agree to rounding. d1 - rho reverses the addition that made
// d1, so that the last bits of D are those of d1 and rho, not of f2. Without this tolerance, a lens
// that ImageDistanceMm focuses at infinity could be found to have no plane of focus.
double FocusExtensionMm(const ThickLens& lens, double image_distance_mm, double rear_distance_mm) {
  const double extension_mm = rear_distance_mm - lens.rear_focal_length_mm;
  const double largest_mm =
      std::max({std::abs(image_distance_mm), std::abs(lens.lens_thickness_mm), rear_distance_mm});
  const double rounding_mm = 4 * std::numeric_limits<double>::epsilon() * largest_mm;
  return std::abs(extension_mm) <= rounding_mm ? 0.0 : extension_mm;
}

void CheckDepth(double depth_mm) {
  if (!(depth_mm > 0)) {
    throw Error(fmt::format("depth_mm is {}: it must be > 0, in front of the aperture", depth_mm));
  }
}

void CheckFocusDepth(const ThickLens& lens, double focus_depth_mm) {
  if (!(focus_depth_mm > lens.front_focal_length_mm)) {
    throw Error(fmt::format(
        "focus_depth_mm is {}: it must be above the front focal length {} mm, because a nearer "
        "object has no real image",
        focus_depth_mm, lens.front_focal_length_mm));
  }
}

bool IsPositive(const char* field, double value, std::string* why) {
  if (value > 0 && std::isfinite(value)) return true;
  return Fail(why, fmt::format("{} is {}: it must be finite and > 0", field, value));
}

}  // namespace

bool ThickLens::IsValid(std::string* why) const {
  if (!IsPositive("front_focal_length_mm", front_focal_length_mm, why)) return false;
  if (!IsPositive("rear_focal_length_mm", rear_focal_length_mm, why)) return false;
  if (!std::isfinite(lens_thickness_mm)) {
    return Fail(why, fmt::format("lens_thickness_mm is {}: it must be finite", lens_thickness_mm));
  }
  return IsPositive("aperture_radius_mm", aperture_radius_mm, why);
}

ThickLens ThinLensEquivalent(const ThickLens& lens) {
  ThickLens thin = lens;
  thin.rear_focal_length_mm = lens.front_focal_length_mm;
  thin.lens_thickness_mm = 0;
  return thin;
}

double ImageDistanceMm(const ThickLens& lens, double focus_depth_mm) {
  CheckFocusDepth(lens, focus_depth_mm);
  // zf/(zf - f1), 1 at infinity. The form 1/(1 - f1/zf) would lose digits close to f1.
  const double stretch = std::isinf(focus_depth_mm)
                             ? 1.0
                             : focus_depth_mm / (focus_depth_mm - lens.front_focal_length_mm);
  return lens.lens_thickness_mm + lens.rear_focal_length_mm * stretch;
}

double FocusDepthMm(const ThickLens& lens, double image_distance_mm) {
  const double rear_distance_mm = RearDistanceMm(lens, image_distance_mm);
  const double extension_mm = FocusExtensionMm(lens, image_distance_mm, rear_distance_mm);
  if (extension_mm == 0) return kInfinity;
  if (!(extension_mm > 0)) {
    throw Error(
        fmt::format("image_distance_mm is {}: it must be at least {}, lens_thickness_mm plus "
                    "rear_focal_length_mm, because no object is in focus on a nearer sensor",
                    image_distance_mm, lens.lens_thickness_mm + lens.rear_focal_length_mm));
  }
  return lens.front_focal_length_mm * (rear_distance_mm / extension_mm);
}

double ImageDistanceSlope(const ThickLens& lens, double focus_depth_mm) {
  CheckFocusDepth(lens, focus_depth_mm);
  const double past_focal_point_mm = focus_depth_mm - lens.front_focal_length_mm;
  // Two quotients instead of one square avoid overflow in any unit of length; 0 at infinity.
  return -(lens.rear_focal_length_mm / past_focal_point_mm) *
         (lens.front_focal_length_mm / past_focal_point_mm);
}

// K = f1 D/f2 follows from [S13]: zf - f1 = f1 f2/(D - f2), so that f1 zf/(zf - f1) = f1 D/f2. This
// form needs no zf and is finite for a focus at infinity, where D = f2 gives f1.
double DefocusScaleMm(const ThickLens& lens, double image_distance_mm) {
  return lens.front_focal_length_mm * RearDistanceMm(lens, image_distance_mm) /
         lens.rear_focal_length_mm;
}

// Both terms of [S26]/[S25] divided by z: c = K/z - (D - f2)/f2. The values are the same, and a
// point at infinity has the finite value -(D - f2)/f2.
double DefocusPerAperture(const ThickLens& lens, double image_distance_mm, double depth_mm) {
  CheckDepth(depth_mm);
  const double rear_distance_mm = RearDistanceMm(lens, image_distance_mm);
  return DefocusScaleMm(lens, image_distance_mm) / depth_mm -
         FocusExtensionMm(lens, image_distance_mm, rear_distance_mm) / lens.rear_focal_length_mm;
}

double BlurRadiusMm(const ThickLens& lens, double image_distance_mm, double depth_mm) {
  return std::abs(lens.aperture_radius_mm * DefocusPerAperture(lens, image_distance_mm, depth_mm));
}

double ChiefRayMagnification(const ThickLens& lens, double image_distance_mm, double depth_mm) {
  CheckDepth(depth_mm);
  return -DefocusScaleMm(lens, image_distance_mm) / depth_mm;
}

double FrontNodalDepthMm(const ThickLens& lens) {
  return lens.front_focal_length_mm - lens.rear_focal_length_mm;
}

double RearNodalDistanceMm(const ThickLens& lens) {
  return lens.lens_thickness_mm + lens.rear_focal_length_mm - lens.front_focal_length_mm;
}

// near = 1/(1/zf + e), far = 1/(1/zf - e) with e = r_max/(r K) in 1/mm; far is +inf once e >= 1/zf.
DepthOfField DepthOfFieldMm(const ThickLens& lens, double image_distance_mm,
                            double max_blur_radius_mm) {
  if (!(max_blur_radius_mm >= 0)) {
    throw Error(fmt::format("max_blur_radius_mm is {}: it must be >= 0", max_blur_radius_mm));
  }
  const double focus_depth_mm = FocusDepthMm(lens, image_distance_mm);
  if (max_blur_radius_mm == 0) return {focus_depth_mm, focus_depth_mm};
  const double half_width_per_mm =
      max_blur_radius_mm / (lens.aperture_radius_mm * DefocusScaleMm(lens, image_distance_mm));
  const double inverse_focus_per_mm = 1 / focus_depth_mm;
  const double inverse_far_per_mm = inverse_focus_per_mm - half_width_per_mm;
  return {1 / (inverse_focus_per_mm + half_width_per_mm),
          inverse_far_per_mm > 0 ? 1 / inverse_far_per_mm : kInfinity};
}

}  // namespace thicklens::model
