#ifndef THICKLENS_MODEL_THICK_LENS_H_
#define THICKLENS_MODEL_THICK_LENS_H_

#include <string>

namespace thicklens::model {

// A thick lens: two principal planes and the focal lengths on both sides.
//
// Conventions of everything below: depths are measured along the axis from the aperture plane Ap,
// positive toward the scene; Ap coincides with the front principal plane. The image distance d1 is
// measured from Ap to the sensor, so that D = d1 - rho is the distance from the rear principal
// plane to the sensor.
struct ThickLens {
  double front_focal_length_mm = 0;  // f1, effective, > 0, from the front principal plane
  double rear_focal_length_mm = 0;   // f2, effective, > 0, from the rear principal plane
  double lens_thickness_mm = 0;      // rho, front to rear principal plane; < 0: crossed planes
  double aperture_radius_mm = 0;     // r, of the aperture plane Ap

  // True if every number is finite and in its range; else `why` names the field and the value.
  bool IsValid(std::string* why) const;
};

// The lens as a thin one, for comparison: f1 = f2 = the front value, rho = 0.
ThickLens ThinCounterpart(const ThickLens& lens);

// d1 = rho + f2 zf/(zf - f1), mm, for the plane of focus zf, mm. From [S13]: 1 = f2/D + f1/zf.
// Throws Error unless zf > f1 (a nearer object has no real image). zf = +inf gives rho + f2.
double ImageDistanceMm(const ThickLens& lens, double focus_depth_mm);

// zf = f1 D/(D - f2), mm, the inverse of ImageDistanceMm. D = f2 gives +inf (focus at infinity);
// throws Error if D < f2: such a sensor is in front of every image.
double FocusDepthMm(const ThickLens& lens, double image_distance_mm);

// [D2] d d1/d zf = -f2 f1/(zf - f1)^2: how an error of the focus depth goes into the image
// distance.
double ImageDistanceSlope(const ThickLens& lens, double focus_depth_mm);

// K = f1 zf/(zf - f1), mm; f1 for a focus at infinity. Signed displacement on the sensor is
// aperture position times c(z), c(z) = K (1/z - 1/zf). Equal to f1 D/f2. [D3]
double DefocusScaleMm(const ThickLens& lens, double image_distance_mm);

// c(z) = [f1 D - (D - f2) z]/(f2 z), dimensionless, positive for points nearer than zf.
// [S26] over [S25]. Throws Error unless depth_mm > 0.
double DefocusPerAperture(const ThickLens& lens, double image_distance_mm, double depth_mm);

// r_defocus = |r c(z)|, mm on the sensor: [S25], [S26]. 0 in the plane of focus.
double BlurRadiusMm(const ThickLens& lens, double image_distance_mm, double depth_mm);

// Size on the sensor over size in the scene along the chief ray (through the centre of Ap), signed:
// m = -f1 D/(f2 z) [D5]. The image is inverted. At z = zf this is the conjugate magnification.
double ChiefRayMagnification(const ThickLens& lens, double image_distance_mm, double depth_mm);

// Depths of the nodal points from Ap [D1]. N1 lies f1 - f2 in front of Ap (positive toward the
// scene); N2 lies rho + f2 - f1 behind it (positive toward the sensor).
double FrontNodalDepthMm(const ThickLens& lens);
double RearNodalDistanceMm(const ThickLens& lens);

// Depths between which the blur radius stays at or below a limit; far_mm may be +inf.
struct DepthOfField {
  double near_mm = 0;
  double far_mm = 0;
};
// From |1/z - 1/zf| <= r_max/(r K), derived here [D6]. A limit of 0 gives (zf, zf).
DepthOfField DepthOfFieldMm(const ThickLens& lens, double image_distance_mm,
                            double max_blur_radius_mm);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_THICK_LENS_H_
