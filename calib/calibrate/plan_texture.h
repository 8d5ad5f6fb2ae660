#ifndef THICKLENS_CALIB_CALIBRATE_PLAN_TEXTURE_H_
#define THICKLENS_CALIB_CALIBRATE_PLAN_TEXTURE_H_

#include "calib/spectrum/texture_spectrum.h"
#include "thicklens/calib/sweep_plan.h"

namespace thicklens::calib {

// Width of a px on the target in the plane of focus, mm: p (zf - f1)/f1.
double PixelAtFocusMm(const PlanConditions& conditions);

// The texture of the conditions with a size of its detail.
Texture TextureOf(const PlanConditions& conditions, double feature_size_mm);

// As ExpectSweep, for valid conditions, with a spectrum that was made before.
ExpectedSweep ExpectSweepOf(const PlanConditions& conditions, const SweepDesign& design,
                            const TextureSpectrum& texture, bool with_parts);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_PLAN_TEXTURE_H_
