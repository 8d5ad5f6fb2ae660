#ifndef THICKLENS_MODEL_SCHEMA_FORMER_BLUR_RATIO_H_
#define THICKLENS_MODEL_SCHEMA_FORMER_BLUR_RATIO_H_

#include "thicklens/model/camera.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::model {

// Camera files of the schema thicklens/camera/1 contain the blur ratio of an aperture before the
// fall-off [S12] narrowed its blur. Since thicklens/camera/2 the blur ratio is that of the blur
// itself.

// [D28] The square of the ratio of the blur, kappa^2 E[w A_x^2]/(E[w] sigma^2), dimensionless, with
// sigma = kappa r and the mean E over the aperture's transmission. On the axis
//   w = (1 + |A|^2/zf^2)^(-1/2) (1 + |A|^2/d1^2)^(-3/2).
// The means are computed by Gauss rules in A^2; the error is 1e-6 for sigma below d1/4. Requires
// zf > f1 and kappa >= 0.
struct BlurRatioOfBlur {
  double squared = 0;
  // Derivatives of `squared`, the latter per mm.
  double by_blur_ratio = 0, by_focus_depth = 0;
};
BlurRatioOfBlur BlurRatioWithFalloff(const ThickLens& lens, Psf psf, double blur_ratio,
                                     double focus_depth_mm);

// Converts the blur ratio of a camera that was read from a thicklens/camera/1 file, with its sigma
// and its covariance, and adds a remark to `camera->notices`. Values that were assumed, or found by
// the recipe of the paper, have always been ratios of the blur and remain unchanged.
void ConvertFormerBlurRatio(Camera* camera);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_SCHEMA_FORMER_BLUR_RATIO_H_
