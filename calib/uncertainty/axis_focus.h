#ifndef THICKLENS_CALIB_UNCERTAINTY_AXIS_FOCUS_H_
#define THICKLENS_CALIB_UNCERTAINTY_AXIS_FOCUS_H_

#include "thicklens/calib/calibration.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {

// [D197] Moves the results of a sweep with a moving target by `move_mm` from the zf of the fit, the
// mean over a curved field, to the zf on the axis. d1, the magnification at focus and the reading
// at focus follow zf; `reading_sign` is that of dz/d reading. kappa K is what the frames show, so
// that kappa changes as 1/K with K = f1 zf/(zf - f1). The error of the move is independent of the
// other errors: it is added in quadrature to those of zf, d1 and the reading, and to their
// covariances. Intervals and parts of the systematic error keep their distances from zf. Needs zf
// and d1.
void MoveFocus(const model::Estimate& move_mm, double reading_sign, const model::ThickLens& lens,
               Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_AXIS_FOCUS_H_
