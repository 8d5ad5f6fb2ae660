#ifndef THICKLENS_MODEL_GREY_FOCUS_H_
#define THICKLENS_MODEL_GREY_FOCUS_H_

#include "thicklens/base/export.h"
#include "thicklens/model/lens_aberrations.h"

namespace thicklens::model {

// Part of red, green and blue in grey light (ToGrey).
inline constexpr double kGreyWeights[] = {0.2126, 0.7152, 0.0722};

// [D198] zf of the grey frames of a grey target, mm: the variance of the blur of grey light is the
// mean of those of its colours, which is smallest at the mean of their 1/zf, with kGreyWeights.
// `focus_depth_mm` is the zf from which the aberrations displace the colours. Without axial colour
// it is zf of grey.
THICKLENS_EXPORT double GreyFocusDepthMm(const LensAberrations& aberrations, double focus_depth_mm);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_GREY_FOCUS_H_
