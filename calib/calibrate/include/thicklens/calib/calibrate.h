#ifndef THICKLENS_CALIB_CALIBRATE_H_
#define THICKLENS_CALIB_CALIBRATE_H_

#include <string>

#include "thicklens/base/export.h"
#include "thicklens/base/progress.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/frame_checks.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// What Calibrate computes, and how it is run.
struct CalibrationOptions {
  QualityCheckOptions checks;  // limits of the quality checks
  // If false, only the paper's recipe and the sharpness peak are computed. Where the bench offset
  // is given they need no image scale, and no frame is registered: a wrong reading is not noticed.
  bool fit_blur = true;
  bool map_field = true;      // includes tiles and colour channels; needs the fit
  int threads = 0;            // 0: one per core
  ProgressFunction progress;  // called from time to time

  // Returns whether all members are in their range. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// Whether a calibration can be attempted at all: counts the frames and the different readings,
// without opening a frame. If not, `why` receives the reason.
THICKLENS_EXPORT bool HasEnoughFrames(const FocusSweep& sweep, std::string* why);

// Runs the quality checks, the estimators and both methods. Bad data give a Calibration whose
// outcome is kRefused or kPartial, with the reason. A wrong file or setting throws Error, and a
// cancelled CancelScope throws Interrupted.
THICKLENS_EXPORT Calibration Calibrate(const FocusSweep& sweep, const CalibrationOptions& options);

// Returns the camera with the calibrated values, as it is written to a file. The manufacturer's
// values are unchanged. With `use_source_recipe`, d1 and kappa are those of the paper's recipe;
// their sigmas are 0 because the recipe has no error estimate, not because they are exact.
THICKLENS_EXPORT model::Camera CalibratedCamera(const model::Camera& camera,
                                                const Calibration& calibration,
                                                bool use_source_recipe);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_H_
