#ifndef THICKLENS_CALIB_REGISTRATION_MOVING_SCALE_H_
#define THICKLENS_CALIB_REGISTRATION_MOVING_SCALE_H_

#include <optional>
#include <vector>

#include "calib/registration/image_scale.h"
#include "thicklens/model/sweep_file.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::calib {

// The image scales of a sweep in which the lens or the sensor moves and the target stands still.
struct MovingScale {
  // Change of ln(scale) per mm of reading at focus. 0 +- 0: too few scales.
  model::Estimate slope_per_mm;
  // D at the reading at focus, mm from the rear principal plane; absent where the scales determine
  // it by less than a third of its distance from the focal point.
  std::optional<model::Estimate> sensor_distance_mm;
  double chi2_per_dof = 0;  // of the law with the best D
};

// Fits scale = a D/z [D139] with D = xf + s (reading - focus_reading) and z = zf (the sensor moves)
// or z = zf - (D - xf) (the lens moves), zf the conjugate of xf, to the scales in (a, xf), robustly
// (Cauchy). Each scale has its own error and the one that the reading's error gives it; both are
// widened where the scatter about the law is larger.
MovingScale FitMovingScale(const std::vector<ScaleSample>& samples, const model::ThickLens& lens,
                           model::SweepMotion moves, double sign, double focus_reading_mm,
                           double reading_sigma_mm);

// Length of a step where the readings are counts [D147]: g in D = xf + g (count - focus_count) of
// the same law, for an xf that is known, robustly (Cauchy). It is negative where D falls with the
// count. The error includes the scatter of the scales and their common error; 0 +- infinity for too
// few scales.
model::Estimate FitStepLength(const std::vector<ScaleSample>& samples, const model::ThickLens& lens,
                              model::SweepMotion moves, double focus_count,
                              double sensor_distance_mm);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_MOVING_SCALE_H_
