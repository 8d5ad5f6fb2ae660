#ifndef THICKLENS_CALIB_NEXT_MEASUREMENT_H_
#define THICKLENS_CALIB_NEXT_MEASUREMENT_H_

#include <optional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// The error of one result before and after a measurement: half of the interval that holds the truth
// in 95 % of the cases (HalfWidth).
struct ExpectedChange {
  double now = 0;         // in the unit of the result
  double afterwards = 0;  // likewise, expected
};

// A measurement that makes the largest term of the error smaller.
struct NextMeasurement {
  bool done = false;                // true if there is an error and an action against it
  std::string message = "not run";  // how it ended; without a proposal, the reason
  // Name of the term that the action is for: the largest of ErrorTerms that has a remedy.
  std::string term;
  // Name of the largest term, if it is another one because that one has no remedy; otherwise empty.
  std::string larger_term;
  double share = 0;    // part of the sum of all terms' effects that the term has
  std::string action;  // what to do, as a sentence without its stop
  std::optional<ExpectedChange> focus_depth_mm;  // of zf; absent where zf was not found
  std::optional<ExpectedChange> blur_ratio;      // of kappa; absent where kappa was not found
};

// Proposes the measurement. For a statistical term, changes of the sweep are compared by their
// Fisher information (ExpectSweep), scaled to the errors of this sweep; a systematic term has the
// action of its remedy, and the errors afterwards are bounds of what is left without it [D165].
THICKLENS_EXPORT NextMeasurement ProposeNext(const FocusSweep& sweep,
                                             const Calibration& calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_NEXT_MEASUREMENT_H_
