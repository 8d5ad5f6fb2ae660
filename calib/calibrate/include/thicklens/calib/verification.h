#ifndef THICKLENS_CALIB_VERIFICATION_H_
#define THICKLENS_CALIB_VERIFICATION_H_

#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// Whether a stored calibration still holds, from a new sweep of the same camera.

struct VerificationOptions {
  // The stored calibration does not hold where the joint chi-square is larger than chance makes it
  // in this share of the cases; 0.0027 is three sigma.
  double significance = 0.0027;
  // The camera stands on the bench as it did: the bench zero is compared too.
  bool same_bench = false;
  // A sweep that would not show a change of the blur of this size cannot tell that there is none:
  // px of sigma, by a change of d1, and the share of kappa.
  double needed_blur_px = 0.5;
  double needed_blur_ratio = 0.1;

  bool IsValid(std::string* why) const;
};

// One quantity, stored and found.
struct ComparedParameter {
  std::string name;  // as in files: "image_distance_mm"
  model::Estimate stored, found;
  double difference = 0;        // found less stored
  double systematic_sigma = 0;  // of the difference, of the new sweep's systematic parts
  double sigma = 0;             // of the difference, all of it
  double deviation() const;     // difference over sigma
  bool counted = false;         // in the joint chi-square
  std::string why_not_counted;
  // The smallest change of this parameter alone that the joint test finds in 95 % of the cases; 0
  // where it is not counted.
  double smallest_detectable = 0;
};

enum class Verdict { kHolds, kDoesNotHold, kCannotTell };
std::string VerdictName(Verdict verdict);  // "holds", "does-not-hold", "cannot-tell"

struct Verification {
  Verdict verdict = Verdict::kCannotTell;
  std::string reason = "not run";
  std::vector<ComparedParameter> parameters;  // what both have: d1, zf, kappa, floor, bench zero
  int degrees_of_freedom = 0;                 // parameters that are counted
  double chi_square = 0;
  double p_value = 1;
  // The blur, px of sigma, that the smallest detectable change of d1 causes at the depth of focus.
  double detectable_blur_px = 0;
  std::vector<std::string> warnings;  // one line each
};

// Compares `found`, the calibration of `sweep`, with that of `stored`, whose lens and sensor the
// sweep was calibrated with. Both covariance matrices count; stored values have no systematic
// interval in the file, so that those parts of the new sweep that the numbers of the camera file do
// not cause (they move both alike) are counted once, as if even over their intervals. The depth of
// focus follows from d1: it is listed and not counted. Throws Error if `stored` has no calibration.
Verification VerifyCalibration(const model::Camera& stored, const FocusSweep& sweep,
                               const Calibration& found, const VerificationOptions& options);

// P(chi^2 >= x) of so many degrees of freedom (>= 1), and the x that is exceeded with probability
// p in (0, 1).
double ChiSquareTail(double x, int degrees_of_freedom);
double ChiSquareExceeded(double p, int degrees_of_freedom);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_VERIFICATION_H_
