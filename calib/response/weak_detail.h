#ifndef THICKLENS_CALIB_RESPONSE_WEAK_DETAIL_H_
#define THICKLENS_CALIB_RESPONSE_WEAK_DETAIL_H_

#include <opencv2/core/types.hpp>
#include <optional>

#include "calib/response/response_frames.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// Measures whether weak detail is lost beyond what the blur takes [D123]. A lens is linear: it
// multiplies detail of one frequency by the same factor, whatever its contrast. Noise reduction and
// compression remove what is as weak as noise. In a band of the frequencies, the detail y of a
// blurred frame is compared with the detail p that the blur leaves of the sharpest frame; a second
// sharp frame z with independent noise gives a weight to both, r = sum y z/sum p z, so that noise
// changes no mean. Within each part of the field, r is compared between places of little and of
// much contrast c: r = r0 (1 + loss ln(c/c0)). Because r0 is free in each part, field curvature,
// tilt and vignetting have no effect. Pixels with clipped values in their neighbourhood are left
// out. The blur itself makes all detail weaker: a loss that depends on contrast alone raises kappa
// by kLossToRatio times itself. Returns nothing where the frames do not determine it, and for a
// periodic target: its contrasts differ only by their place in the pattern, where the frequencies
// differ, too.
std::optional<model::Estimate> MeasureWeakDetailLoss(const ResponseFrames& frames, cv::Size size);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_RESPONSE_WEAK_DETAIL_H_
