#ifndef THICKLENS_MODEL_OBJECTIVE_H_
#define THICKLENS_MODEL_OBJECTIVE_H_

#include <string>

#include "thicklens/base/export.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::model {

// Data on the barrel of a microscope objective for air, corrected for infinity.
struct Objective {
  double magnification = 0;              // M > 0, with the tube lens below
  double numerical_aperture = 0;         // NA, between 0 and 1
  double tube_lens_focal_length_mm = 0;  // F > 0, mm

  // Returns true if every number is finite and in its range. Otherwise `why`, if not null, gets the
  // field and the value.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The thin lens f1 = f2 = F/M, rho = 0 that has at its plane of focus, zf = f1 (1 + 1/M), the
// objective's magnification and its cone of light, r = zf tan(asin(NA)) [D128]. Magnification, blur
// and depths relative to focus are those of objective and tube lens together; zf and d1 are those
// of the equivalent lens, not lengths that can be measured on the microscope. Throws Error unless
// the objective is valid.
THICKLENS_EXPORT ThickLens LensOfObjective(const Objective& objective);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_OBJECTIVE_H_
