#ifndef THICKLENS_MODEL_LENS_ABERRATIONS_H_
#define THICKLENS_MODEL_LENS_ABERRATIONS_H_

#include <Eigen/Core>
#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"

namespace thicklens::model {

// Aberrations that displace the plane of focus, and the distortion of the image. The plane of focus
// zf is the medial focus on the axis: the mean in 1/z of the depths at which the blur along two
// perpendicular directions is smallest. rho is the distance of an image position from the axis over
// that of the farthest corner of the image.
struct LensAberrations {
  // Medial zf in that corner minus zf on the axis, mm; it is proportional to rho^2.
  double field_curvature_mm = 0;
  // In that corner, the depth at which the blur along the tangent is smallest minus that for the
  // blur along the radius (sagittal minus tangential focus), mm; it is proportional to rho^2.
  double field_astigmatism_mm = 0;
  // Depth of least blur along x minus that along y, everywhere in the field, mm: a tilted or
  // squeezed element.
  double astigmatism_mm = 0;
  // Relative displacement of the image point of that corner away from the axis, dimensionless;
  // negative: barrel. A point at the distance r is displaced by distortion r rho^2.
  double distortion = 0;
  // zf of red, green and blue light minus zf, mm, everywhere in the field. The sensor is where it
  // is, so that K and the size of the image are the same for all colours. Present: frames in
  // colour; absent: in grey.
  std::optional<Eigen::Vector3d> axial_colour_mm;

  // Whether any of those that depend on direction or place in the field differs from 0. The
  // distortion displaces no focus, and the axial colour is the same everywhere.
  bool DisplaceFocus() const {
    return field_curvature_mm != 0 || field_astigmatism_mm != 0 || astigmatism_mm != 0;
  }
  // Returns whether every focus stays in front of the focal length and the distortion can be
  // inverted. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(const ThickLens& lens, double focus_depth_mm,
                                std::string* why) const;
};

// Distance of the farthest corner of the image from the axis, px.
THICKLENS_EXPORT double FarthestCornerPx(const Sensor& sensor);

// The displacement of the plane of focus, 1/mm, as a symmetric matrix Delta: the blur along the
// unit vector n is smallest at a depth z with 1/z = 1/zf + n^T Delta n, for the eigenvectors n of
// Delta [D150]. The displacement of a ray on the sensor is (c(z) I - K Delta) times its position on
// Ap (DefocusPerAperture, DefocusScaleMm). `from_axis_px` is the position on the sensor.
THICKLENS_EXPORT Eigen::Matrix2d FocusDisplacement(const LensAberrations& aberrations,
                                                   double focus_depth_mm,
                                                   const Eigen::Vector2d& from_axis_px,
                                                   double farthest_corner_px);

// The displacement of the plane of focus by axial colour, 1/mm, of red (0), green (1) or blue (2)
// light: 1/(zf + axial_colour_mm) - 1/zf, as a multiple of the identity in FocusDisplacement.
// 0 without axial colour.
THICKLENS_EXPORT double ColourDisplacement(const LensAberrations& aberrations,
                                           double focus_depth_mm, int colour);

// The position that a lens without distortion would give to a position of the image. Both are in px
// from the axis.
THICKLENS_EXPORT Eigen::Vector2d WithoutDistortion(double distortion,
                                                   const Eigen::Vector2d& from_axis_px,
                                                   double farthest_corner_px);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_LENS_ABERRATIONS_H_
