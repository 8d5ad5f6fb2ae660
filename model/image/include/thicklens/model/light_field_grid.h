#ifndef THICKLENS_MODEL_LIGHT_FIELD_GRID_H_
#define THICKLENS_MODEL_LIGHT_FIELD_GRID_H_

#include <Eigen/Core>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::model {

// One ray of the two-plane light field, mm: (s, t) on ST, (u, v) on UV. Seen from the scene: s and
// u to the right, t and v down.
struct Ray {
  double s_mm = 0, t_mm = 0, u_mm = 0, v_mm = 0;
};

// Where the two planes lie: UV at depth zl, ST at depth zl + d0.
struct LightFieldPlanes {
  double uv_depth_mm = 0;       // zl
  double plane_spacing_mm = 0;  // d0, not 0
};

// P and Q of [S17], [S18], dimensionless: landing = P s - Q u.
struct ProjectionCoefficients {
  double p = 0;
  double q = 0;
};
ProjectionCoefficients ProjectionOf(const ThickLens& lens, double image_distance_mm,
                                    const LightFieldPlanes& planes);

// [S16], [M13]: where the ray meets the sensor, mm from the optical axis, in scene orientation (the
// image is inverted: positive is what the picture shows left of or above the principal point).
Eigen::Vector2d LandingPointMm(const ThickLens& lens, double image_distance_mm,
                               const LightFieldPlanes& planes, const Ray& ray);

// [S14], [S15]: the same through the ray's crossing with the plane of focus and the nodal points.
// Kept as an independent way to [S16]; undefined for a focus at infinity (throws Error).
Eigen::Vector2d LandingPointByNodalPointsMm(const ThickLens& lens, double image_distance_mm,
                                            const LightFieldPlanes& planes, const Ray& ray);

// [S10]: where the ray crosses the aperture plane, mm.
Eigen::Vector2d ApertureCrossingMm(const LightFieldPlanes& planes, const Ray& ray);

// Position of the ray at a depth, mm [D10]: [s (z - zl) + u (zl + d0 - z)]/d0, likewise t, v.
Eigen::Vector2d PositionAtDepthMm(const LightFieldPlanes& planes, const Ray& ray, double depth_mm);

// Picture position of a landing point, px [D11]: x = cx - i_x/p, y = cy - i_y/p.
Eigen::Vector2d PicturePositionPx(const Sensor& sensor, const Eigen::Vector2d& landing_mm);

// cos(alpha) = 1/sqrt(1 + ((u - s)^2 + (v - t)^2)/d0^2): [S8] written so that it is finite at
// zl = 0. alpha is the angle between the ray in the scene and the axis.
double CosAlpha(const LightFieldPlanes& planes, const Ray& ray);

// cos(beta) of [S9], beta the angle behind the lens, with d1 measured from Ap. Erratum of the
// source, kept: for rho != 0 the rear principal plane would be the right one.
double CosBeta(const ThickLens& lens, double image_distance_mm, const LightFieldPlanes& planes,
               const Ray& ray);

// cos(alpha) cos^3(beta): the part of [S12] that differs from ray to ray ([S1], [S2], [S3], [S4],
// [S5], [S6], [S7], [S11]). The rest, k/d1^2
// ((zl + d0)/d0)^2 du dv, is one constant, fixed by exposure [M11] (see LightFieldGrid).
double RelativeIrradiance(const ThickLens& lens, double image_distance_mm,
                          const LightFieldPlanes& planes, const Ray& ray);

// Transmission of the aperture [D12] at (a_u, a_v), mm from the axis, 1 at its centre.
// Gaussian: standard deviation kappa r per axis, not cut at r (then the PSF is exactly Gaussian
// with sigma = kappa r_defocus). Disc: 1 inside the radius 2 kappa r, 0 outside (kappa 0.5: the
// full aperture); its second moment is that of the Gaussian.
double ApertureTransmission(Psf psf, double blur_ratio, double aperture_radius_mm,
                            const Eigen::Vector2d& crossing_mm);

// How the aperture weights the views of a light field [D13].
enum class ApertureShape {
  kUniform,   // all alike
  kGaussian,  // exp(-(4 a/U)^2/2) per axis: +-2 standard deviations over the samples
  kDisc,      // 1 inside a^2/(U/2)^2 + b^2/(V/2)^2 <= 1, 0 outside
};
ApertureShape ApertureShapeFromName(const std::string& name);  // "uniform", "gaussian", "disc"
std::string ApertureShapeName(ApertureShape shape);
ApertureShape ApertureShapeOf(Psf psf);

// The same, 1 in the middle, at a place of the aperture that need not be a view's: steps from the
// middle. The uniform one is 1 as far as half a step beyond the outermost views, else 0.
double ApertureWeightAt(ApertureShape shape, int u_count, int v_count,
                        const Eigen::Vector2d& offset_steps);

// V x U weights, sum 1. Throws Error unless both counts are >= 1.
Eigen::ArrayXXd ApertureWeights(ApertureShape shape, int u_count, int v_count);

// The directional samples of a light field whose UV plane lies on the aperture: U x V offsets
// a_i = i - (U-1)/2 times `step`, each with a weight; the weights sum to 1.
//
// The steps are such that the samples carry exactly the calibrated blur: the weighted second moment
// of the positions about their centroid is (kappa r)^2 per axis. Derived [D14]: with a_k from the
// centroid, sum_k w_k (a_k da)^2 = (kappa r)^2 gives da = kappa r/sqrt(sum_k w_k a_k^2). The
// weights are those of a point on the axis, its fall-off included: whatever [S12] does there is in
// the calibrated blur. An axis with one sample carries no blur; its step is 0. (The spacing 4 kappa
// r/U, a first guess, carries 12 % too little blur at U = 7.)
struct ApertureSamples {
  int u_count = 1;
  int v_count = 1;
  double u_step_mm = 0;
  double v_step_mm = 0;
  Eigen::ArrayXXd weights;  // V x U, sum 1

  double u_offset(int i) const { return i - (u_count - 1) / 2.0; }
  double v_offset(int j) const { return j - (v_count - 1) / 2.0; }
};
// Throws Error unless blur_ratio, aperture_radius_mm >= 0 and the weights are >= 0 with sum 1.
ApertureSamples SampleAperture(const Eigen::ArrayXXd& weights, double blur_ratio,
                               double aperture_radius_mm);
// With the weights of the PSF's shape. Throws Error, too, unless u_count, v_count >= 1.
ApertureSamples SampleAperture(Psf psf, double blur_ratio, double aperture_radius_mm, int u_count,
                               int v_count);

// The sampled light field: rays (i, j, k, l) at s_i, t_j on ST and u_k, v_l on UV.
struct LightFieldGrid {
  int s_count = 0, t_count = 0, u_count = 0, v_count = 0;
  LightFieldPlanes planes;
  double s_step_mm = 0, t_step_mm = 0, u_step_mm = 0, v_step_mm = 0;
  Eigen::Vector2d st_origin_index{0, 0};  // index (i, j) of the ST sample on the optical axis

  // True if the counts are positive and the planes possible; else `why` names field and value.
  bool IsValid(std::string* why) const;

  Ray RayAt(int i, int j, int k, int l) const;
};

// The default grid of a calibrated camera: UV on the aperture (zl = 0), ST in the plane of focus
// (d0 = zf, so Q = 0 up to rounding), one s-step one pixel (ds = p/|P|), S x T the sensor, the
// samples those of SampleAperture. Throws Error if the camera is not calibrated or focused at
// infinity (ST would lie there).
LightFieldGrid DefaultGrid(const Camera& camera, int u_count, int v_count);

// A grid on planes of the user's choice: one s-step one pixel (ds = p/|P|), and directional steps
// with which the rays of the point on the axis in focus cross the aperture in those of
// SampleAperture, whatever the planes: du = da (zf - zl)/zf. Throws Error for zl >= zf
// (P = 0 at zl = zf: the rays no longer separate the pixels), zl + d0 <= 0 or d0 = 0.
LightFieldGrid GridOnPlanes(const Camera& camera, const LightFieldPlanes& planes, int u_count,
                            int v_count);

// The same for given samples, where the weights are not those of the camera's PSF.
LightFieldGrid GridOnPlanes(const Camera& camera, const LightFieldPlanes& planes,
                            const ApertureSamples& samples);

// Step between views on the aperture, mm, along u and v, of the rays through the point on the axis
// in focus: a = u zf/(zf - zl), whatever d0. Of the default grid the grid's own steps.
Eigen::Vector2d ApertureStepsMm(const LightFieldGrid& grid, const Camera& camera);

// [D16] m = (z - zl - d0) du/((z - zl) ds): the step of s, in samples, per view step at a fixed
// scene point. For Q = 0 it is minus the disparity. Throws Error at z = zl, where it is infinite.
double SlopeOnGrid(const LightFieldGrid& grid, double depth_mm);

// [D17] d(z) = da c(z)/p: disparity, px per view step of `aperture_step_mm`, near positive, 0 in
// the plane of focus: what the centre view shows at x stands at x - a d in view a.
double DisparityPx(const Camera& camera, double aperture_step_mm, double depth_mm);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_LIGHT_FIELD_GRID_H_
