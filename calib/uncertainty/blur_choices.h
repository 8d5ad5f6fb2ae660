#ifndef THICKLENS_CALIB_UNCERTAINTY_BLUR_CHOICES_H_
#define THICKLENS_CALIB_UNCERTAINTY_BLUR_CHOICES_H_

#include "calib/fit/blur_measurement.h"

namespace thicklens::calib {

// What the spectra of the frames that are left in the spectral meter's samples say, without those
// that were thrown out, which would have had a say in the texture: the samples are renewed where
// any was. Then with the other choices that could have been made: half the band, and the other
// shape of the blur over the band that both can be fitted in, so that the two can be compared;
// and the curves of three frames for the eye. Does nothing where there is no spectral meter; a
// choice that cannot be fitted is left out.
void CompareChoices(model::Psf stated, BlurEvidence* evidence);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_BLUR_CHOICES_H_
