#ifndef THICKLENS_CALIB_VERIFICATION_H_
#define THICKLENS_CALIB_VERIFICATION_H_

#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

struct FocusSweep;  // thicklens/calib/focus_sweep.h, which needs OpenCV's headers

// The check whether a stored calibration still holds, from a new sweep of the same camera.

// The limits of the verdict.
struct VerificationOptions {
  // The stored calibration does not hold if the joint chi-square exceeds the value that chance
  // exceeds in this share of the cases; 0.0027 is three sigma.
  double significance = 0.0027;
  // True if the camera has not been moved on the bench: the bench offset is then compared too.
  bool same_bench = false;
  // The change of the blur that a sweep must be able to detect; otherwise its agreement proves
  // nothing. A change by d1 is in px of sigma, and a change of kappa is a share of kappa.
  double needed_blur_px = 0.5;
  double needed_blur_ratio = 0.1;  // share of kappa

  // Returns whether all members are in their range. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// One quantity, with its stored and its new value.
struct ComparedParameter {
  std::string name;                           // as in files: "image_distance_mm"
  model::Estimate stored, found;              // value of the file, value of the new sweep
  double difference = 0;                      // found minus stored
  double systematic_sigma = 0;                // part of sigma from the new sweep's systematic parts
  double sigma = 0;                           // standard deviation of the difference, in all
  THICKLENS_EXPORT double deviation() const;  // difference over sigma; 0 if sigma is 0
  bool counted = false;                       // included in the joint chi-square
  std::string why_not_counted;                // empty if it is counted
  // The smallest change of this parameter alone that the joint test finds in 95 % of the cases. It
  // is 0 where the parameter is not counted.
  double smallest_detectable = 0;
};

// The stored calibration agrees with the sweep (kHolds) or does not (kDoesNotHold), or the sweep
// could not have detected a change (kUndetermined).
enum class Verdict { kHolds, kDoesNotHold, kUndetermined };
// "holds", "does-not-hold", "cannot-tell".
THICKLENS_EXPORT std::string VerdictName(Verdict verdict);

// The verdict, and the comparison behind it.
struct Verification {
  Verdict verdict = Verdict::kUndetermined;   // whether the calibration holds
  std::string reason = "not run";             // one line: why this is the verdict
  std::vector<ComparedParameter> parameters;  // present in both: d1, zf, kappa, floor, bench offset
  int degrees_of_freedom = 0;                 // number of counted parameters
  double chi_square = 0;                      // joint chi^2 of the counted parameters
  double p_value = 1;                         // probability that chance alone exceeds it
  // The blur, px of sigma, that the smallest detectable change of d1 causes at the in-focus
  // distance.
  double detectable_blur_px = 0;
  std::vector<std::string> warnings;  // one line each
};

// Compares `found`, the calibration of `sweep`, with that of `stored`, whose lens and sensor the
// sweep was calibrated with. Both covariance matrices count. The file states no systematic interval
// of the stored values. Therefore the systematic parts of the new sweep are counted once, with an
// even distribution over their intervals, except those that the numbers of the camera file cause:
// they move both calibrations alike. The in-focus object distance follows from d1: it is listed and
// not counted. Throws Error if `stored` has no calibration or if the options are not valid.
THICKLENS_EXPORT Verification VerifyCalibration(const model::Camera& stored,
                                                const FocusSweep& sweep, const Calibration& found,
                                                const VerificationOptions& options);

// ChiSquareTail returns P(chi^2 >= x) for a number of degrees of freedom (>= 1). ChiSquareExceeded
// returns the x that is exceeded with probability p in (0, 1).
THICKLENS_EXPORT double ChiSquareTail(double x, int degrees_of_freedom);
// Returns the x that chi^2 exceeds with probability p in (0, 1), for a number of degrees of freedom
// (>= 1).
THICKLENS_EXPORT double ChiSquareExceeded(double p, int degrees_of_freedom);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_VERIFICATION_H_
