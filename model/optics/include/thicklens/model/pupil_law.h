#ifndef THICKLENS_MODEL_PUPIL_LAW_H_
#define THICKLENS_MODEL_PUPIL_LAW_H_

#include <string>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::model {

// How the light of a point spreads over the pupil [D24]. A is the position on the aperture plane
// Ap, i the position on the sensor from the principal point, both mm and upright, T the
// transmission of the camera's PSF shape. On the axis (i = 0) the density of the light over A is
//   kUniform       T(A)
//   kPaper         T(A) cos(alpha) cos^3(beta), [S12]
//   kCosineFourth  T(A) cos^4(beta)
//   kSineCondition T(|A| cos(beta)) cos^4(beta): uniform over the direction cosines of the rays
//                  behind the lens, as Abbe's sine condition has it for a Lambertian point
// with tan(alpha) = |A|/zf and tan(beta) = |A|/d1. Real pupils follow none of them exactly.
enum class PupilLaw { kUniform, kPaper, kCosineFourth, kSineCondition };
const std::vector<PupilLaw>& AllPupilLaws();
std::string PupilLawName(PupilLaw law);              // "uniform", "paper", "cos4", "sine"
PupilLaw PupilLawFromName(const std::string& name);  // throws Error that lists the names

// The optics that a pupil law needs.
struct PupilOptics {
  Psf psf = Psf::kGaussian;      // shape of T: a Gaussian, or a disc of radius twice its sigma
  double sigma_mm = 0;           // kappa r: second-moment sigma of the light over A, per axis
  double focus_depth_mm = 0;     // zf, may be infinite
  double image_distance_mm = 0;  // d1
  double defocus_scale_mm = 0;   // K = f1 zf/(zf - f1)
};
PupilOptics PupilOpticsOf(const ThickLens& lens, Psf psf, double blur_ratio, double focus_depth_mm);

// Pupils with a sigma of more than this part of d1 (wider than about f/0.8) are not described.
inline constexpr double kWidestPupil = 0.3;

// The light of a point on the axis over the pupil, scaled so that its second moment per axis is
// exactly sigma^2 whatever the law (a pupil law changes the shape of the blur, never its
// sigma). The density is held as rings, the nodes of a Gauss rule in A^2 (Laguerre for a Gaussian
// T, Legendre for a disc), so that its transfer function is a sum of Bessel functions J0. Rays
// steeper than 72 degrees behind the lens do not exist. Derived here [D25]; checked by ray sums in
// the tests.
class PupilProfile {
 public:
  // `largest_x`: how far Transfer of a disc is to be exact. Throws Error unless sigma, zf and d1
  // are > 0 and a T with that second moment exists.
  PupilProfile(PupilLaw law, const PupilOptics& optics, double largest_x = 10);

  // The transfer function of the blur at x = 2 pi sigma_px nu, sigma_px the blur's sigma on the
  // sensor, nu in cycles per px. Error below 1e-8 up to `largest_x`. Beyond x = 10, that of a
  // Gaussian T is 0; beyond `largest_x` (or 40), that of a disc is a series about its edge, with an
  // error below 1e-6 (1e-9 from x = 100 on).
  double Transfer(double x) const;

  struct Ring {
    double radius = 0;  // over sigma
    double share = 0;   // of the light; all shares sum to 1
  };
  const std::vector<Ring>& rings() const { return rings_; }

  // Of a disc: its radius R over sigma, and the density of the light over u = (A/sigma)^2 at R^2
  // with its first two derivatives. Farther out there is no light.
  struct DiscEdge {
    double radius = 0, density = 0, slope = 0, bend = 0;
  };

  // T's own sigma over sigma.
  double transmission_ratio() const { return transmission_ratio_; }
  // The mean of A over i for a point off the axis, to the first order in i.
  double mean_per_landing() const { return mean_per_landing_; }
  Psf psf() const { return psf_; }

 private:
  double Sum(double x) const;
  double TransferOfEdge(double x) const;

  Psf psf_;
  std::vector<Ring> rings_;
  double transmission_ratio_ = 1, mean_per_landing_ = 0;
  DiscEdge edge_;
  std::vector<double> table_;  // Transfer at multiples of the step, from one step below 0
};

// The mean of A displaces what is out of focus by c(z) times it, c(z) = K (1/z - 1/zf), in
// proportion to i: the image looks as if the rays came through a point in front of the aperture, at
// this depth, mm: g K/(g K/zf - 1), g the mean per landing. Derived here [D27]: the size in the
// image goes as 1/(z (1 + c g)), and z (1 + c g) is a straight line in z with its zero there. Needs
// zf > f1, kappa >= 0; of a pupil beyond kWidestPupil, that of the widest. 0 for the uniform law.
double CentreOfPerspectiveMm(const ThickLens& lens, Psf psf, PupilLaw law, double blur_ratio,
                             double focus_depth_mm);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_PUPIL_LAW_H_
