#ifndef THICKLENS_CALIB_SWEEP_TRANSFER_H_
#define THICKLENS_CALIB_SWEEP_TRANSFER_H_

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/slanted_edge.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// The MTF of one frame, with the box of the pixel.
struct FrameTransfer {
  std::size_t frame = 0;  // index into the sweep
  // True: measured at slanted edges of the frame. False: computed from the fitted blur, with the
  // floor as a Gaussian and the defocus with the shape of the camera's PSF, along the rows.
  bool is_measured = false;
  int edges = 0;                                // number of slanted edges behind a measured curve
  ModulationTransfer curve;                     // mean of the edges; without `sigma` if modelled
  std::optional<model::Estimate> mtf50, mtf10;  // cycles per px at 50 % and at 10 % contrast
};

// MTF through focus: of the frames of a sweep, and of the plane of focus itself.
struct SweepTransfer {
  bool done = false;                      // true if some frame has a curve
  std::string message = "not run";        // how it ended; without a result, the reason
  std::vector<FrameTransfer> frames;      // those that were not rejected, in the order of the sweep
  std::optional<FrameTransfer> at_focus;  // modelled, in the plane of focus; `frame` has no meaning
};

// Conversion of frequencies: cycles per px into line pairs per mm.
struct TransferUnits {
  double sensor_lp_per_mm = 0;  // of 1 cycle per px on the sensor
  // Of 1 cycle per px in the plane of focus, by the magnification f1/(zf - f1) there; absent: the
  // plane of focus is not known or at infinity.
  std::optional<double> object_lp_per_mm;
};
// The units of a camera; px are those of its sensor.
THICKLENS_EXPORT TransferUnits TransferUnitsOf(const model::Camera& camera);

// Measures the MTF of every frame that was not rejected at its slanted edges, where the target has
// some (`target: knife-edge` or `printed-edge`, or the blur was measured at edges). A frame without
// a usable edge gets the modelled curve of the fitted law at its depth. The frames are read one at
// a time by each of `threads` threads. Throws Interrupted after a request to stop.
THICKLENS_EXPORT SweepTransfer MeasureSweepTransfer(const FocusSweep& sweep,
                                                    const Calibration& calibration, int threads);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_SWEEP_TRANSFER_H_
