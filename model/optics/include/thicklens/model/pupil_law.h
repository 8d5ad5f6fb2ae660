#ifndef THICKLENS_MODEL_PUPIL_LAW_H_
#define THICKLENS_MODEL_PUPIL_LAW_H_

#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::model {

// The distribution of the light of a point over the pupil [D24]. A is the position on the aperture
// plane Ap, i the position on the sensor from the principal point; both are in mm and upright. T is
// the transmission of the camera's PSF shape. On the axis (i = 0) the density of the light over A
// is
//   kUniform       T(A)
//   kPaper         T(A) cos(alpha) cos^3(beta), [S12]
//   kCosineFourth  T(A) cos^4(beta)
//   kSineCondition T(|A| cos(beta)) cos^4(beta): uniform over the direction cosines of the rays
//                  behind the lens, as Abbe's sine condition requires for a Lambertian point
// with tan(alpha) = |A|/zf and tan(beta) = |A|/d1. Real pupils follow none of these laws exactly.
enum class PupilLaw { kUniform, kPaper, kCosineFourth, kSineCondition };
THICKLENS_EXPORT const std::vector<PupilLaw>& AllPupilLaws();  // in the order of the enumeration
THICKLENS_EXPORT std::string PupilLawName(PupilLaw law);       // "uniform", "paper", "cos4", "sine"
// Inverse of PupilLawName. Throws Error, which lists the names, for any other name.
THICKLENS_EXPORT PupilLaw PupilLawFromName(const std::string& name);

// The optical quantities that a pupil law needs.
struct PupilOptics {
  Psf psf = Psf::kGaussian;      // shape of T: a Gaussian, or a disc of radius twice its sigma
  double sigma_mm = 0;           // kappa r: second-moment sigma of the light over A, per axis
  double focus_depth_mm = 0;     // zf, from Ap; may be infinite
  double image_distance_mm = 0;  // d1, from Ap to the sensor
  double defocus_scale_mm = 0;   // K = f1 zf/(zf - f1)
};
// Throws Error unless focus_depth_mm > f1.
THICKLENS_EXPORT PupilOptics PupilOpticsOf(const ThickLens& lens, Psf psf, double blur_ratio,
                                           double focus_depth_mm);

// Largest sigma/d1 of a pupil. Wider pupils (wider than about f/0.8) are not described.
inline constexpr double kWidestPupil = 0.3;

// The light of a point on the axis over the pupil. It is scaled so that its second moment per axis
// is exactly sigma^2 under every law: a pupil law changes the shape of the blur, never its sigma.
// The density is represented by rings, the nodes of a Gauss rule in A^2 (Laguerre for a Gaussian T,
// Legendre for a disc), so that its transfer function is a sum of Bessel functions J0. Rays steeper
// than 72 degrees behind the lens do not exist. Derived here [D25]; the tests check it by ray sums.
class THICKLENS_EXPORT PupilProfile {
 public:
  // Transfer of a disc is computed from the rings up to `largest_x`. Throws Error unless sigma, zf
  // and d1 are > 0 and a T with that second moment exists.
  PupilProfile(PupilLaw law, const PupilOptics& optics, double largest_x = 10);

  // The transfer function of the blur, dimensionless, at x = 2 pi sigma_px nu, where sigma_px is
  // the sigma of the blur on the sensor and nu is in cycles per px. The error is below 1e-8 up to
  // `largest_x`. For a Gaussian T the function is 0 beyond x = 10. For a disc it is a series about
  // the edge beyond `largest_x` (or 40, if that is larger), with an error below 1e-6 (1e-9 from
  // x = 100 on).
  double Transfer(double x) const;

  // A ring of the pupil with a share of the light of the point.
  struct Ring {
    double radius = 0;  // radius on Ap divided by sigma
    double share = 0;   // share of the light; all shares sum to 1
  };
  // The rings that represent the density of the light.
  const std::vector<Ring>& rings() const { return rings_; }

  // Edge of a disc: its radius R divided by sigma, and the density of the light over
  // u = (A/sigma)^2 at R^2 with its first two derivatives. There is no light beyond the edge.
  struct DiscEdge {
    double radius = 0, density = 0, slope = 0, bend = 0;  // R/sigma; density and its derivatives
  };

  // The sigma of T divided by sigma.
  double transmission_ratio() const { return transmission_ratio_; }
  // The mean of A divided by i for a point off the axis, to first order in i.
  double mean_per_landing() const { return mean_per_landing_; }
  // The shape of T.
  Psf psf() const { return psf_; }

 private:
  double Sum(double x) const;
  double TransferOfEdge(double x) const;

  Psf psf_;
  std::vector<Ring> rings_;
  double transmission_ratio_ = 1, mean_per_landing_ = 0;
  DiscEdge edge_;
  std::vector<double> table_;  // Transfer at multiples of the table's step, from one step below 0
};

// Depth of the centre of perspective, mm from Ap, positive toward the scene: g K/(g K/zf - 1), g
// the mean per landing. The mean of A, which is in proportion to i, displaces defocused points on
// the sensor by c(z) times that mean, c(z) = K (1/z - 1/zf). The image therefore looks as if the
// rays came through a point at this depth. Derived here [D27]: the size in the image is in
// proportion to 1/(z (1 + c g)), and z (1 + c g) is a straight line in z whose zero is this depth.
// Requires zf > f1 and kappa >= 0. A pupil wider than kWidestPupil is replaced by the widest one.
// The result is 0 for the uniform law and for kappa = 0.
THICKLENS_EXPORT double CentreOfPerspectiveMm(const ThickLens& lens, Psf psf, PupilLaw law,
                                              double blur_ratio, double focus_depth_mm);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_PUPIL_LAW_H_
