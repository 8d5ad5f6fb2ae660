#ifndef THICKLENS_CALIB_FIT_BLUR_TAILS_H_
#define THICKLENS_CALIB_FIT_BLUR_TAILS_H_

#include <Eigen/Core>
#include <optional>

#include "calib/fit/blur_measurement.h"

namespace thicklens::calib {

// The tails of RelativeBlur: the departure of the blur's shape from the family's at constant second
// moment. Pupil laws cause them.

// Applies tails to the family where the frames show beyond doubt tails that a pupil law gives, but
// never more than the laws give. The measured variances are corrected for them, and the fit must
// then be repeated. Returns false if nothing was changed. `fit` gives zf and kappa, on which the
// laws depend.
bool TakeTails(model::Psf psf, const BlurFitResult& fit, BlurEvidence* evidence);

// Returns the interval (lowest, highest) by which the tails may still depart from those of the
// family. It reaches as far as the frames allow and a pupil law gives; where the frames show larger
// tails beyond doubt, it reaches to these. Returns nothing without spectra.
std::optional<Eigen::Vector2d> TailsLeft(model::Psf psf, const BlurFitResult& fit,
                                         const BlurEvidence& evidence);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_TAILS_H_
