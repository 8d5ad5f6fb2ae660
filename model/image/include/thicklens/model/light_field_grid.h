#ifndef THICKLENS_MODEL_LIGHT_FIELD_GRID_H_
#define THICKLENS_MODEL_LIGHT_FIELD_GRID_H_

#include <Eigen/Core>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"

namespace thicklens::model {

// One ray of the two-plane light field, mm: (s, t) on ST, (u, v) on UV. In the orientation of the
// scene, s and u are to the right, t and v down.
struct Ray {
  double s_mm = 0, t_mm = 0, u_mm = 0, v_mm = 0;  // positions from the optical axis, mm
};

// Positions of the two planes, mm from Ap: UV at depth zl, ST at depth zl + d0. Every function
// below that takes the planes throws Error unless both numbers are finite and d0 is not 0.
struct LightFieldPlanes {
  double uv_depth_mm = 0;       // zl
  double plane_spacing_mm = 0;  // d0, not 0
};

// P and Q of [S17], [S18], dimensionless: the landing point is P s - Q u.
struct ProjectionCoefficients {
  double p = 0;  // P [S17], 0 at zl = zf
  double q = 0;  // Q [S18], 0 with ST in the plane of focus
};
// Computes P and Q [S17], [S18] of the planes. Throws Error unless D = d1 - rho is finite and > 0.
THICKLENS_EXPORT ProjectionCoefficients ProjectionOf(const ThickLens& lens,
                                                     double image_distance_mm,
                                                     const LightFieldPlanes& planes);

// Landing point of the ray on the sensor, mm from the optical axis: [S16], [M13]. The orientation
// is that of the scene. The optical image is inverted, so that a positive coordinate is left of or
// above the principal point in the encoded image.
THICKLENS_EXPORT Eigen::Vector2d LandingPointMm(const ThickLens& lens, double image_distance_mm,
                                                const LightFieldPlanes& planes, const Ray& ray);

// Landing point of the ray on the sensor, mm from the optical axis, computed from the ray's
// crossing with the plane of focus and from the nodal points: [S14], [S15]. This independent
// derivation checks [S16]. Throws Error for a focus at infinity, where it is undefined.
THICKLENS_EXPORT Eigen::Vector2d LandingPointByNodalPointsMm(const ThickLens& lens,
                                                             double image_distance_mm,
                                                             const LightFieldPlanes& planes,
                                                             const Ray& ray);

// Crossing of the ray with the aperture plane Ap, mm from the optical axis: [S10].
THICKLENS_EXPORT Eigen::Vector2d ApertureCrossingMm(const LightFieldPlanes& planes, const Ray& ray);

// Position of the ray at the depth z, mm from the optical axis [D10]:
// [s (z - zl) + u (zl + d0 - z)]/d0, and likewise for t, v. Throws Error unless z is finite.
THICKLENS_EXPORT Eigen::Vector2d PositionAtDepthMm(const LightFieldPlanes& planes, const Ray& ray,
                                                   double depth_mm);

// Position of a landing point in the image, px [D11]: x = cx - i_x/p, y = cy - i_y/p.
THICKLENS_EXPORT Eigen::Vector2d ImagePositionPx(const Sensor& sensor,
                                                 const Eigen::Vector2d& landing_mm);

// cos(alpha) = 1/sqrt(1 + ((u - s)^2 + (v - t)^2)/d0^2), where alpha is the angle between the ray
// in the scene and the axis: [S8] in a form that is finite at zl = 0.
THICKLENS_EXPORT double CosAlpha(const LightFieldPlanes& planes, const Ray& ray);

// cos(beta) of [S9], where beta is the angle between the ray behind the lens and the axis, with d1
// measured from Ap. Erratum of the paper, kept: for rho != 0 the rear principal plane would be the
// correct reference.
THICKLENS_EXPORT double CosBeta(const ThickLens& lens, double image_distance_mm,
                                const LightFieldPlanes& planes, const Ray& ray);

// Relative irradiance cos(alpha) cos^3(beta): the factor of [S12] that differs from ray to ray
// ([S1], [S2], [S3], [S4], [S5], [S6], [S7], [S11]). The other factor, k/d1^2 ((zl + d0)/d0)^2
// du dv, is a constant that the exposure determines [M11] (see LightFieldGrid).
THICKLENS_EXPORT double RelativeIrradiance(const ThickLens& lens, double image_distance_mm,
                                           const LightFieldPlanes& planes, const Ray& ray);

// Transmission of the aperture [D12] at (a_u, a_v), mm from the axis; 1 at its centre.
// Gaussian: the standard deviation is kappa r per axis, without a cut at r, so that the PSF is
// exactly Gaussian with sigma = kappa r_defocus. Disc: 1 inside the radius 2 kappa r, 0 outside
// (kappa = 0.5: the full aperture); its second moment is that of the Gaussian. Throws Error unless
// kappa r is finite and >= 0.
THICKLENS_EXPORT double ApertureTransmission(Psf psf, double blur_ratio, double aperture_radius_mm,
                                             const Eigen::Vector2d& crossing_mm);

// Weights of the views of a light field over the aperture [D13], before normalisation.
enum class ApertureShape {
  kUniform,   // the same weight for all views
  kGaussian,  // exp(-(4 a/U)^2/2) per axis: +-2 standard deviations over the samples
  kDisc,      // 1 inside a^2/(U/2)^2 + b^2/(V/2)^2 <= 1, 0 outside
};
// The shape of the name "uniform", "gaussian" or "disc". Throws Error for any other name.
THICKLENS_EXPORT ApertureShape ApertureShapeFromName(const std::string& name);
// Name of the shape: "uniform", "gaussian" or "disc".
THICKLENS_EXPORT std::string ApertureShapeName(ApertureShape shape);
// The shape of the aperture that has this PSF: kDisc for a disc, kGaussian for a Gaussian.
THICKLENS_EXPORT ApertureShape ApertureShapeOf(Psf psf);

// Weight, 1 in the middle, at any position of the aperture, in view steps from the middle; the
// position need not be that of a view. The uniform weight is 1 up to half a step beyond the
// outermost views and 0 outside.
THICKLENS_EXPORT double ApertureWeightAt(ApertureShape shape, int u_count, int v_count,
                                         const Eigen::Vector2d& offset_steps);

// V x U weights of the views with the sum 1. Throws Error unless both counts are >= 1.
THICKLENS_EXPORT Eigen::ArrayXXd ApertureWeights(ApertureShape shape, int u_count, int v_count);

// The directional samples of a light field whose UV plane is the aperture: U x V offsets
// a_i = i - (U-1)/2 times `step`, each with a weight; the weights sum to 1.
//
// The steps give the samples exactly the calibrated blur: the weighted second moment of the
// positions about their centroid is (kappa r)^2 per axis. Derived here [D14]: with a_k from the
// centroid, sum_k w_k (a_k da)^2 = (kappa r)^2 gives da = kappa r/sqrt(sum_k w_k a_k^2). The
// weights are those of a point on the axis and include its fall-off, because the calibrated blur
// contains the effect of [S12] there. An axis with one sample has no blur; its step is 0. (The
// spacing 4 kappa r/U, a first guess, gives 12 % too little blur at U = 7.)
struct ApertureSamples {
  int u_count = 1;          // U, number of samples across
  int v_count = 1;          // V, number of samples down
  double u_step_mm = 0;     // step across on Ap, mm; 0 for one sample
  double v_step_mm = 0;     // step down on Ap, mm; 0 for one sample
  Eigen::ArrayXXd weights;  // V x U, sum 1

  // Steps to the right from the middle: i - (U-1)/2.
  double u_offset(int i) const { return i - (u_count - 1) / 2.0; }
  // Steps down from the middle: j - (V-1)/2.
  double v_offset(int j) const { return j - (v_count - 1) / 2.0; }
};
// Samples with the given V x U weights. Throws Error unless blur_ratio and aperture_radius_mm are
// finite and >= 0 and the weights are >= 0 with the sum 1.
THICKLENS_EXPORT ApertureSamples SampleAperture(const Eigen::ArrayXXd& weights, double blur_ratio,
                                                double aperture_radius_mm);
// Samples with the weights of the PSF's shape. Throws Error also unless u_count, v_count >= 1.
THICKLENS_EXPORT ApertureSamples SampleAperture(Psf psf, double blur_ratio,
                                                double aperture_radius_mm, int u_count,
                                                int v_count);

// The sampling of a light field: the ray (i, j, k, l) passes through s_i, t_j on ST and u_k, v_l on
// UV.
struct LightFieldGrid {
  int s_count = 0, t_count = 0, u_count = 0, v_count = 0;  // S, T, U and V
  LightFieldPlanes planes;                                 // depths of UV and ST from Ap
  // Steps on ST (s, t) and on UV (u, v), mm.
  double s_step_mm = 0, t_step_mm = 0, u_step_mm = 0, v_step_mm = 0;
  Eigen::Vector2d st_origin_index{0, 0};  // index (i, j) of the optical axis on ST, not rounded

  // Returns true if the counts and the steps on ST are positive, the planes possible and all
  // numbers finite. Otherwise `why`, if not null, gets the field and the value.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;

  // Returns the ray (i, j, k, l): s = (i - st_origin_index.x) s_step_mm, u = (k - (U-1)/2)
  // u_step_mm, and t and v likewise.
  THICKLENS_EXPORT Ray RayAt(int i, int j, int k, int l) const;
};

// The default grid of a calibrated camera: UV is the aperture plane (zl = 0), ST the plane of focus
// (d0 = zf, so that Q = 0 up to rounding), one step of s is one pixel (ds = p/|P|), S x T is the
// size of the sensor, and the directional samples are those of SampleAperture. Throws Error if the
// camera is not calibrated or is focused at infinity (where ST would be).
THICKLENS_EXPORT LightFieldGrid DefaultGrid(const Camera& camera, int u_count, int v_count);

// A grid on planes of the user's choice: one step of s is one pixel (ds = p/|P|). The directional
// steps are such that, on any planes, the rays of the point on the axis in focus cross the aperture
// in the steps of SampleAperture: du = da (zf - zl)/zf. Throws Error if the camera is not
// calibrated, and for zl >= zf (P = 0 at zl = zf: the rays no longer separate the pixels),
// zl + d0 <= 0 or d0 = 0.
THICKLENS_EXPORT LightFieldGrid GridOnPlanes(const Camera& camera, const LightFieldPlanes& planes,
                                             int u_count, int v_count);

// The grid on these planes for given samples, whose weights need not be those of the camera's PSF.
THICKLENS_EXPORT LightFieldGrid GridOnPlanes(const Camera& camera, const LightFieldPlanes& planes,
                                             const ApertureSamples& samples);

// Step between views on the aperture, mm, along u and v, for the rays through the point on the axis
// in focus: a = u zf/(zf - zl), independent of d0. For the default grid these are the u and v steps
// of the grid.
THICKLENS_EXPORT Eigen::Vector2d ApertureStepsMm(const LightFieldGrid& grid, const Camera& camera);

// [D16] Slope m = (z - zl - d0) du/((z - zl) ds): the step of s, in samples, per view step at a
// fixed scene point. For Q = 0 it is minus the disparity. Throws Error unless z > 0, and at z = zl,
// where the slope is infinite.
THICKLENS_EXPORT double SlopeOnGrid(const LightFieldGrid& grid, double depth_mm);

// [D17] Disparity d(z) = da c(z)/p, px per view step of `aperture_step_mm`; near positive, 0 in the
// plane of focus. A scene point at x in the centre view is at x - a d in the view a. Throws Error
// unless z > 0.
THICKLENS_EXPORT double DisparityPx(const Camera& camera, double aperture_step_mm, double depth_mm);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_LIGHT_FIELD_GRID_H_
