#ifndef THICKLENS_CALIB_FIT_BLUR_TAILS_H_
#define THICKLENS_CALIB_FIT_BLUR_TAILS_H_

#include <Eigen/Core>
#include <optional>

#include "calib/fit/blur_measurement.h"

namespace thicklens::calib {

// The tails of RelativeBlur: how the shape of the blur departs from the family's while its second
// moment stays. Pupil laws make them.

// Where the frames show beyond doubt tails that a pupil law gives, the family gets them: the
// measured variances answer, and the fit is to be run again. At most those of the laws are taken.
// False: nothing was changed. `fit` gives zf and kappa, on which the laws depend.
bool TakeTails(model::Psf psf, const BlurFitResult& fit, BlurEvidence* evidence);

// How far the tails may still depart from those of the family: to what the frames ask for, as far
// as a pupil law makes that; beyond where they ask for it beyond doubt. Nothing without spectra.
std::optional<Eigen::Vector2d> TailsLeft(model::Psf psf, const BlurFitResult& fit,
                                         const BlurEvidence& evidence);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_TAILS_H_
