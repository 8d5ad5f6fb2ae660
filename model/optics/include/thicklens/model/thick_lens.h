#ifndef THICKLENS_MODEL_THICK_LENS_H_
#define THICKLENS_MODEL_THICK_LENS_H_

#include <string>

#include "thicklens/base/export.h"

namespace thicklens::model {

// A thick lens: two principal planes and the focal lengths on both sides.
//
// Conventions of this header: depths are measured along the axis from the aperture plane Ap and are
// positive toward the scene. Ap coincides with the front principal plane. The image distance d1 is
// measured from Ap to the sensor, so that D = d1 - rho is the distance from the rear principal
// plane to the sensor. Every function with an image distance throws Error unless D is finite
// and > 0.
struct ThickLens {
  double front_focal_length_mm = 0;  // f1, effective, > 0, from the front principal plane
  double rear_focal_length_mm = 0;   // f2, effective, > 0, from the rear principal plane
  double lens_thickness_mm = 0;      // rho, front to rear principal plane; < 0: crossed planes
  double aperture_radius_mm = 0;     // r, radius of the aperture in the plane Ap

  // Returns true if every number is finite and in its range. Otherwise `why`, if not null, gets the
  // field and the value.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The thin lens for comparison: f1 = f2 = the front focal length of `lens`, rho = 0, the same
// aperture.
THICKLENS_EXPORT ThickLens ThinLensEquivalent(const ThickLens& lens);

// Image distance d1 = rho + f2 zf/(zf - f1), mm, for the plane of focus zf, mm. From [S13]:
// 1 = f2/D + f1/zf. Throws Error unless zf > f1 (a nearer object has no real image). zf = +inf
// gives rho + f2.
THICKLENS_EXPORT double ImageDistanceMm(const ThickLens& lens, double focus_depth_mm);

// Depth of the plane of focus zf = f1 D/(D - f2), mm: the inverse of ImageDistanceMm. D = f2 gives
// +inf (focus at infinity). Throws Error if D < f2, because such a sensor is in front of every
// image.
THICKLENS_EXPORT double FocusDepthMm(const ThickLens& lens, double image_distance_mm);

// [D2] d d1/d zf = -f2 f1/(zf - f1)^2, dimensionless: the factor by which an error of the focus
// depth propagates to the image distance. Throws Error unless zf > f1.
THICKLENS_EXPORT double ImageDistanceSlope(const ThickLens& lens, double focus_depth_mm);

// Defocus scale K = f1 zf/(zf - f1) = f1 D/f2, mm; it is f1 for a focus at infinity. The signed
// displacement on the sensor is the aperture position times c(z), c(z) = K (1/z - 1/zf). [D3]
THICKLENS_EXPORT double DefocusScaleMm(const ThickLens& lens, double image_distance_mm);

// Defocus per aperture c(z) = [f1 D - (D - f2) z]/(f2 z), dimensionless, positive for points nearer
// than zf: the quotient of [S26] and [S25]. Throws Error unless depth_mm > 0.
THICKLENS_EXPORT double DefocusPerAperture(const ThickLens& lens, double image_distance_mm,
                                           double depth_mm);

// Blur radius r_defocus = |r c(z)|, mm on the sensor: [S25], [S26]. It is 0 in the plane of focus.
// Throws Error unless depth_mm > 0.
THICKLENS_EXPORT double BlurRadiusMm(const ThickLens& lens, double image_distance_mm,
                                     double depth_mm);

// Magnification along the chief ray (through the centre of Ap), size on the sensor over size in the
// scene, dimensionless: m = -f1 D/(f2 z) [D5]. The sign is negative because the image is inverted.
// At z = zf this is the conjugate magnification. Throws Error unless depth_mm > 0.
THICKLENS_EXPORT double ChiefRayMagnification(const ThickLens& lens, double image_distance_mm,
                                              double depth_mm);

// Positions of the nodal points from Ap, mm [D1]. N1 is f1 - f2 in front of Ap (positive toward the
// scene); N2 is rho + f2 - f1 behind it (positive toward the sensor).
THICKLENS_EXPORT double FrontNodalDepthMm(const ThickLens& lens);
// Distance of the rear nodal point N2 from Ap, mm: rho + f2 - f1, positive toward the sensor [D1].
THICKLENS_EXPORT double RearNodalDistanceMm(const ThickLens& lens);

// Depths from Ap between which the blur radius is at most a limit; far_mm may be +inf.
struct DepthOfField {
  double near_mm = 0;  // the nearer end, mm from Ap
  double far_mm = 0;   // the farther end, mm from Ap
};
// Depth of field for the largest blur radius r_max, mm on the sensor, from
// |1/z - 1/zf| <= r_max/(r K); derived here [D6]. A limit of 0 gives (zf, zf). Throws Error unless
// the limit is >= 0.
THICKLENS_EXPORT DepthOfField DepthOfFieldMm(const ThickLens& lens, double image_distance_mm,
                                             double max_blur_radius_mm);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_THICK_LENS_H_
