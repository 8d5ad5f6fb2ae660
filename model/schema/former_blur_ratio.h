#ifndef THICKLENS_MODEL_SCHEMA_FORMER_BLUR_RATIO_H_
#define THICKLENS_MODEL_SCHEMA_FORMER_BLUR_RATIO_H_

#include "thicklens/model/camera.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::model {

// Camera files of the schema thicklens/camera/1 hold the blur ratio of an aperture before the
// fall-off [S12] narrowed its blur; since thicklens/camera/2 it is that of the blur itself.

// [D28] The square of the blur's own ratio, kappa^2 E[w A_x^2]/(E[w] sigma^2) with sigma = kappa r,
// the mean E over the aperture's transmission and, on the axis,
//   w = (1 + |A|^2/zf^2)^(-1/2) (1 + |A|^2/d1^2)^(-3/2),
// by Gauss's rules in A^2, to 1e-6 for sigma below d1/4. Needs zf > f1, kappa >= 0.
struct BlurRatioOfBlur {
  double squared = 0;
  double by_blur_ratio = 0, by_focus_depth = 0;  // derivatives of `squared`, the latter per mm
};
BlurRatioOfBlur BlurRatioWithFalloff(const ThickLens& lens, Psf psf, double blur_ratio,
                                     double focus_depth_mm);

// Converts the blur ratio of a camera that was read from a thicklens/camera/1 file, its sigma and
// its covariance, and notes that in `camera->notices`. Values that were assumed, or found by the
// paper's recipe, always were ratios of the blur and stay.
void ConvertFormerBlurRatio(Camera* camera);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_FORMER_BLUR_RATIO_H_
