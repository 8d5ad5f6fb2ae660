#ifndef THICKLENS_CALIB_PSF_MEASUREMENT_H_
#define THICKLENS_CALIB_PSF_MEASUREMENT_H_

#include <functional>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/measured_psf.h"

namespace thicklens::calib {

// Options of a measurement of the PSF.
struct PsfOptions {
  int side = 21;  // rows and columns of the PSF, odd, 7 to 41
  // Half of the width of the PSF's square, in sigmas of the defocus blur, 1.5 to 4. A disc ends at
  // 2, the corners of a square aperture at 2.4.
  double reach_sigmas = 2.7;
  int threads = 1;  // number of threads
  // Called after each frame, (done, total); may be empty.
  std::function<void(int, int)> progress;

  // Returns true if the numbers are in their ranges. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// The measured shape of the defocus blur.
struct PsfMeasurement {
  bool done = false;                // true if there is a PSF
  std::string message = "not run";  // how it ended; without a result, the reason
  model::MeasuredPsf psf;           // its blur ratio is that of the calibration
  int frames = 0;                   // number of frames behind it
  int nearer = 0, farther = 0;      // of which on each side of focus
  // Sigma along x and along y relative to their mean: 1 and 1 for a shape without a direction.
  double sigma_x_ratio = 1, sigma_y_ratio = 1;
};

// Measures the shape from the frames of a sweep whose sharpest frame shows the target itself. A
// defocused frame is, at the scale of the sharpest, its convolution with the PSF at the blur radius
// of the frame; on the near side of focus the PSF is turned by half a turn. The shares of the cells
// of the PSF are found from all pixels of all such frames by non-negative least squares with a
// weak smoothness term, with the errors from the residuals. The result is normalised, has its
// centroid in the middle, and is scaled to the calibrated blur ratio. Frames with a blur radius
// that the PSF's cells do not resolve, or that is too large for the region, are not used. Throws
// Interrupted after a request to stop.
THICKLENS_EXPORT PsfMeasurement MeasurePsf(const FocusSweep& sweep, const Calibration& calibration,
                                           const PsfOptions& options);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_PSF_MEASUREMENT_H_
