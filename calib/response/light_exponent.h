#ifndef THICKLENS_CALIB_RESPONSE_LIGHT_EXPONENT_H_
#define THICKLENS_CALIB_RESPONSE_LIGHT_EXPONENT_H_

#include <opencv2/core/types.hpp>
#include <optional>

#include "calib/response/response_frames.h"
#include "thicklens/model/camera.h"

namespace thicklens::calib {

// Measures the power p to which the values, as they were read, must be raised to be proportional to
// the light [D122]. A lens out of focus spreads the light of a part of the target and loses none.
// The mean m of the light within a window is therefore the same in the sharpest frame, with the
// window blurred as much as the frame, whatever the texture. Of values that are a power of the
// light it is not: with the variance v of the values within the window,
//   ln m_i - ln m_ref = -(p - 1)/2 (v_i/m_i^2 - v_ref/m_ref^2),
// so that the means of textured parts change against those of flat parts. p is found by raising the
// values until no such change is left. What else changes a mean is fitted beside it in every frame:
// gain, black level and stray light, slope of the light, vignetting, errors of shift, scale and
// blur. Windows with clipped values are left out. The sigma is from a jackknife over parts of the
// target and from the scatter of the frames. Returns nothing where the frames do not determine it.
std::optional<model::Estimate> MeasureLightExponent(const ResponseFrames& frames, cv::Size size);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_RESPONSE_LIGHT_EXPONENT_H_
