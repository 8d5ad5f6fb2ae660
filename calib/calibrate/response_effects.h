#ifndef THICKLENS_CALIB_CALIBRATE_RESPONSE_EFFECTS_H_
#define THICKLENS_CALIB_CALIBRATE_RESPONSE_EFFECTS_H_

#include <vector>

#include "calib/fit/blur_measurement.h"
#include "calib/registration/image_scale.h"
#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

// Measures how the camera made its values from the light, and adds it to the diagnostics. What
// contradicts an unprocessed camera with the stated transfer is reported in a warning with its
// effect on kappa, which widens the systematic intervals, or says that this effect is unknown.
// `task` has the registered frames; `evidence` and `fit` are those of the results. Frames of a
// target whose image scale cannot be measured are not examined.
void CheckCameraResponse(const BlurTask& task, const BlurEvidence& evidence,
                         const BlurFitResult& fit, Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_RESPONSE_EFFECTS_H_
