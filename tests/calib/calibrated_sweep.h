#ifndef THICKLENS_TESTS_CALIB_CALIBRATED_SWEEP_H_
#define THICKLENS_TESTS_CALIB_CALIBRATED_SWEEP_H_

#include "tests/calib/simulated_sweep.h"
#include "thicklens/calib/calibrate.h"

namespace thicklens::testing {

// Calibrates a simulated sweep without the map of the field, which takes most of the time.
inline calib::Calibration CalibrateWithoutMap(const SimulatedSweep& simulated) {
  calib::CalibrationOptions options;
  options.map_field = false;
  return calib::Calibrate(simulated.sweep, options);
}

}  // namespace thicklens::testing

#endif  // THICKLENS_TESTS_CALIB_CALIBRATED_SWEEP_H_
