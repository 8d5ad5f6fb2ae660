#ifndef THICKLENS_MODEL_WEIGHED_APERTURE_H_
#define THICKLENS_MODEL_WEIGHED_APERTURE_H_

#include "thicklens/model/camera.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::model {

// An aperture of transmission T and what fall-off needs of the optics it stands in.
struct ApertureOptics {
  Psf psf = Psf::kGaussian;      // T: a Gaussian, or a disc of twice sigma
  double sigma_mm = 0;           // kappa r, standard deviation of T per axis
  double focus_depth_mm = 0;     // zf, may be infinite
  double image_distance_mm = 0;  // d1
};

// What the fall-off (12) makes of an aperture: it weighs the ray through A that lands at i beside
// the principal point (both upright, as the picture shows them) by
//   w = (1 + |i/K - A/zf|^2)^(-1/2) (1 + |i + A|^2/d1^2)^(-3/2), K = f1 zf/(zf - f1),
// so that blur is that of T w, not of T. Derived here, to the first order in i:
//   variance of A per axis  = E[w A_x^2]/E[w]                                    at i = 0,
//   mean of A               = i E[w A_x^2 (1/(K zf (1 + A^2/zf^2)) - 3/(d1^2 + A^2))]/E[w],
// E the mean over T; about sigma^2 (1 - 3 sigma^2/d1^2) of a Gaussian and sigma^2 (1 -
// sigma^2/d1^2) of a disc, and -3 i sigma^2/d1^2. By Gauss's rules, to 1e-6 for sigma below d1/4.
struct WeighedAperture {
  double variance_ratio = 1;  // of the variance over sigma^2
  // Derivatives of variance_ratio by the logarithm of each.
  double by_log_sigma = 0, by_log_focus_depth = 0, by_log_image_distance = 0;
  double mean_per_landing = 0;  // mean of A over i
};
// `scale_mm` is K. Throws nothing: all of `optics` must be > 0, sigma may be 0.
WeighedAperture WeighAperture(const ApertureOptics& optics, double scale_mm);

// The blur ratio of what is seen: kappa is that of T, and the second moment of T w is
// kappa^2 variance_ratio r^2. `lens.aperture_radius_mm` is r; needs zf > f1, kappa may be 0.
struct SeenBlurRatio {
  double squared = 0;
  double by_blur_ratio = 0, by_focus_depth = 0;  // derivatives of `squared`, the latter per mm
};
SeenBlurRatio SeeBlurRatio(const ThickLens& lens, Psf psf, double blur_ratio,
                           double focus_depth_mm);

// The mean of A displaces what is out of focus by c(z) times it, c(z) = K (1/z - 1/zf), in
// proportion to i: the picture looks as if the rays came through a point in front of the aperture,
// at this depth, mm: g K/(g K/zf - 1), g the mean per landing. Derived here: the size in the
// picture goes as 1/(z (1 + c g)), and z (1 + c g) is a straight line in z with its zero there. zf
// > f1.
double CentreOfPerspectiveMm(const ThickLens& lens, Psf psf, double blur_ratio,
                             double focus_depth_mm);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_WEIGHED_APERTURE_H_
