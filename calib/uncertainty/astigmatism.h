#ifndef THICKLENS_CALIB_UNCERTAINTY_ASTIGMATISM_H_
#define THICKLENS_CALIB_UNCERTAINTY_ASTIGMATISM_H_

#include "calib/fit/blur_measurement.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Measures zf and kappa of the blur along x and along y, and fills them into the field of the
// calibration; they are absent where the texture does not determine both. The readings are the
// written ones, and their errors are fitted anew: one isotropic law bends them for an astigmatic
// lens. Frames that only that law rejected take part. Where both directions differ beyond doubt, a
// warning says so, and the intervals of zf, d1 and kappa are widened.
void MeasureAstigmatism(const FocusSweep& sweep, const BlurEvidence& evidence,
                        const BlurFitResult& fit, Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_ASTIGMATISM_H_
