#ifndef THICKLENS_CALIB_UNCERTAINTY_ASTIGMATISM_H_
#define THICKLENS_CALIB_UNCERTAINTY_ASTIGMATISM_H_

#include "calib/fit/blur_measurement.h"
#include "thicklens/calib/calibration.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Where one variance for all directions does not describe the spectra, and the blur along x and
// along y is smallest at depths that differ beyond doubt: replaces the samples of the spectral
// estimator by the mean of both variances, and sets evidence->axial and the half astigmatism of the
// law [D137]. Otherwise changes nothing. Call it before frames are rejected by one isotropic law,
// which an astigmatic lens does not follow. Returns whether it replaced the samples.
bool TakeMeanOfAxes(const FocusSweep& sweep, BlurEvidence* evidence);

// The fit of a region with the mean of both variances, and its blur along both axes. Frames with
// almost no mode in the band are removed, and so are frames that do not show what the others show.
struct FittedAxes {
  EstimatorRegion region;
  AxialBlur blur;
};
FittedAxes FitRegionAlongAxes(EstimatorRegion region, const AxisLeakage& leakage,
                              const RelativeBlurOptions& options);

// Measures zf and kappa of the blur along x and along y, and fills them into the field of the
// calibration; they are absent where the texture does not determine both. The readings are the
// written ones, and their errors are fitted anew: one isotropic law bends them for an astigmatic
// lens. Where both directions differ beyond doubt, a warning says so, and the intervals of zf, d1
// and kappa are widened: by what the mean of both variances leaves open if the fit used it
// (evidence.axial), otherwise by the difference from both directions.
void MeasureAstigmatism(const FocusSweep& sweep, const BlurEvidence& evidence,
                        const BlurFitResult& fit, Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_ASTIGMATISM_H_
