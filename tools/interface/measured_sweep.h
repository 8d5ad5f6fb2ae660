#ifndef THICKLENS_TOOLS_INTERFACE_MEASURED_SWEEP_H_
#define THICKLENS_TOOLS_INTERFACE_MEASURED_SWEEP_H_

#include <memory>

#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/io/frame_files.h"
#include "thicklens/sweep.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

// A sweep as thicklens::calib measured it, and what it found.
struct MeasuredSweep {
  calib::FocusSweep sweep;
  calib::Calibration calibration;
  std::shared_ptr<io::FrameFiles> files;  // null: the frames did not come from files
};

// Reports what was assumed about the sweep and its camera, then calibrates.
MeasuredSweep MeasureSweep(const Sweep& sweep, bool map_field, RunScope* run);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_MEASURED_SWEEP_H_
