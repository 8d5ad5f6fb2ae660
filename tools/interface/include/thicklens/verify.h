#ifndef THICKLENS_VERIFY_H_
#define THICKLENS_VERIFY_H_

#include "thicklens/base/export.h"
#include "thicklens/calib/verification.h"
#include "thicklens/calibrate.h"
#include "thicklens/camera.h"
#include "thicklens/run.h"
#include "thicklens/sweep.h"

namespace thicklens {

using VerifyOptions = calib::VerificationOptions;  // The limits of the verdict.

// Whether a stored calibration still holds: the verdict with its reason, and every compared
// parameter (thicklens/calib/verification.h).
struct CameraVerification : calib::Verification {
  calib::Calibration calibration;  // of the new sweep
};

// Calibrates `stored`'s lens and sensor from a new, possibly short sweep and compares the result
// with the stored calibration. It is what `thicklens camera verify` does. `sweep.camera` is not
// used. A sweep with the same frames as the stored calibration's decides nothing.
//
// Throws OptionError for options that are not valid, Error if `stored` has no calibration or a
// frame cannot be read, and Interrupted.
THICKLENS_EXPORT CameraVerification VerifyCamera(const Camera& stored, const Sweep& sweep,
                                                 const VerifyOptions& options = {},
                                                 const RunControl& run = {});

}  // namespace thicklens

#endif  // THICKLENS_VERIFY_H_
