#ifndef THICKLENS_CALIB_CALIBRATE_H_
#define THICKLENS_CALIB_CALIBRATE_H_

#include <functional>
#include <string>

#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/frame_gates.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

struct CalibrationOptions {
  GateOptions gates;
  // False: the source's recipe and the sharpness peak alone. Where the bench zero is given they
  // need no image scale, and no frame is registered then: a wrong reading is not noticed.
  bool fit_blur = true;
  bool map_field = true;  // tiles and colour channels too; needs the fit
  int threads = 0;        // 0: one per core
  // Called now and then with (steps done, steps in all); false stops the run (Interrupted).
  std::function<bool(int done, int total)> progress;

  bool IsValid(std::string* why) const;
};

// Whether a calibration can be attempted at all: frames and different readings, without opening
// any.
bool HasEnoughFrames(const FocusSweep& sweep, std::string* why);

// Runs the gates, the meters and both methods. Bad data end in a Calibration whose outcome is
// kRefused or kPartial with the reason; a wrong file or setting throws Error.
Calibration Calibrate(const FocusSweep& sweep, const CalibrationOptions& options);

// The camera with what was found, as it is written. Manufacturer's values stay as they are. With
// `use_source_recipe` its d1 and kappa are taken instead; their sigmas are 0, because
// the recipe has no error estimate, not because they are exact.
model::Camera CalibratedCamera(const model::Camera& camera, const Calibration& calibration,
                               bool use_source_recipe);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_CALIBRATE_H_
