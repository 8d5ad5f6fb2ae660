#ifndef THICKLENS_CALIB_UNCERTAINTY_BLUR_CHOICES_H_
#define THICKLENS_CALIB_UNCERTAINTY_BLUR_CHOICES_H_

#include "calib/fit/blur_measurement.h"

namespace thicklens::calib {

// Fits the spectra again where frames of the spectral estimator were rejected, because these had
// influenced the texture, and replaces the estimator's samples. Then fits with the other possible
// choices: half the band, and the other shape of the blur over the band in which both can be
// fitted, so that the two can be compared. Adds the curves of three frames for plots. Does nothing
// where there is no spectral estimator. A choice that cannot be fitted is omitted.
void CompareChoices(model::Psf stated, BlurEvidence* evidence);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_BLUR_CHOICES_H_
