#include "thicklens/model/depth_of_field.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "thicklens/base/error.h"

namespace thicklens::model {
namespace {

double ToleranceOf(const Camera& camera, const char* field) {
  const auto found = camera.statements.find(field);
  return found == camera.statements.end() ? 0 : found->second.tolerance;
}

double DepthOfInverse(double inverse_per_mm) {
  return inverse_per_mm > 0 ? 1 / inverse_per_mm : std::numeric_limits<double>::infinity();
}

// The limit 1/z = 1/f1 - (f2/f1) (1 -+ e)/D [D170]. It is linear in 1/D, so that the interval of D
// gives that of the limit exactly. `side` is 1 - e (near) or 1 + e (far), dimensionless; D and its
// standard deviation are in mm from the rear principal plane. At e = 0 both limits are zf.
DepthLimit LimitOf(const ThickLens& lens, double side, const Estimate& rear_distance_mm) {
  const auto inverse = [&](double distance_mm) {
    return (1 - lens.rear_focal_length_mm * side / distance_mm) / lens.front_focal_length_mm;
  };
  const double distance_mm = rear_distance_mm.value, sigma_mm = rear_distance_mm.sigma;
  DepthLimit limit;
  limit.depth_mm = DepthOfInverse(inverse(distance_mm));
  // A longer image distance focuses nearer.
  limit.interval_mm = {DepthOfInverse(inverse(distance_mm + sigma_mm)),
                       DepthOfInverse(inverse(distance_mm - sigma_mm))};
  if (std::isfinite(limit.depth_mm)) {
    limit.sigma_mm = limit.depth_mm * limit.depth_mm * lens.rear_focal_length_mm * side /
                     (lens.front_focal_length_mm * distance_mm * distance_mm) * sigma_mm;
  }
  return limit;
}

}  // namespace

FocusLimits FocusLimitsOf(const Camera& camera, double circle_of_confusion_mm) {
  const ThickLens& lens = camera.lens;
  if (!(circle_of_confusion_mm > 0) || !(circle_of_confusion_mm < 2 * lens.aperture_radius_mm)) {
    throw Error(fmt::format(
        "circle of confusion: a diameter > 0 and below that of the aperture, {:.6g} mm, is "
        "expected, found {:.6g} mm",
        2 * lens.aperture_radius_mm, circle_of_confusion_mm));
  }
  const double pitch_mm = camera.sensor.pixel_pitch_mm, ratio = camera.blur_ratio();
  const Estimate rear_mm{camera.image_distance_mm() - lens.lens_thickness_mm,
                         camera.calibration->image_distance_mm->sigma};
  const double share = circle_of_confusion_mm / (2 * lens.aperture_radius_mm);  // e
  FocusLimits limits;
  limits.circle_of_confusion_mm = circle_of_confusion_mm;
  limits.circle_of_confusion_px = circle_of_confusion_mm / pitch_mm;
  limits.near = LimitOf(lens, 1 - share, rear_mm);
  limits.far = LimitOf(lens, 1 + share, rear_mm);
  if (limits.far.sigma_mm) {
    // Both limits move with d1 in the same direction.
    limits.depth_of_field_mm = Estimate{limits.far.depth_mm - limits.near.depth_mm,
                                        std::abs(*limits.far.sigma_mm - *limits.near.sigma_mm)};
  }
  // A sensor that is moved by x from the image of a point cuts its cone, of radius r at the rear
  // principal plane, in a circle of radius r |x|/D.
  const double per_distance = circle_of_confusion_mm / lens.aperture_radius_mm;
  limits.depth_of_focus_mm = {per_distance * rear_mm.value, per_distance * rear_mm.sigma};
  const double diameters = 1 / share;
  limits.hyperfocal_mm = lens.front_focal_length_mm * (1 + diameters);
  limits.hyperfocal_tolerance_mm =
      (1 + diameters) * ToleranceOf(camera, "lens.front_focal_length_mm") +
      2 * lens.front_focal_length_mm / circle_of_confusion_mm *
          ToleranceOf(camera, "lens.aperture_radius_mm");
  const double radius_px = limits.circle_of_confusion_px / 2;
  limits.blur_sigma_px = {ratio * radius_px, camera.calibration->blur_ratio->sigma * radius_px};
  return limits;
}

}  // namespace thicklens::model
