#ifndef THICKLENS_CALIB_REGISTRATION_BLUR_SLOPE_H_
#define THICKLENS_CALIB_REGISTRATION_BLUR_SLOPE_H_

#include <optional>
#include <vector>

#include "calib/registration/image_scale.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::calib {

// Growth of the blur sigma, px, per relative change of the image scale, from the blurs that the
// registrations measured. It is good to about 15 %. It does not depend on readings or the bench
// offset, and therefore holds for any readings.
//
// For frames of scale s relative to the sharpest frame (derived here, [D65]; p is the pixel pitch,
// s is near 1):
//   if the target moves, sigma = kappa r K |1/z - 1/zf|/p = kappa r f1/(p (zf - f1)) |s - s0|, from
//     [S25], K = f1 zf/(zf - f1) and s = zf/z;
//   if the lens or the sensor moves, sigma = kappa r |1 - D/D0|/p = kappa r/p |s - s0|, because the
//     size is proportional to D, the distance from the aperture to the sensor.
struct BlurSlope {
  double px = 0;

  // kappa if the target moves and is in focus at the given depth. It is negative nearer than the
  // focal point.
  double RatioOfMovingTarget(const model::Camera& camera, double focus_depth_mm) const;
  double RatioOfMovingLens(const model::Camera& camera) const;
};

// Fits the slope. Returns std::nullopt for fewer than five frames, or where the blur does not grow
// beyond its errors.
std::optional<BlurSlope> FindBlurSlope(const std::vector<ScaleSample>& samples);

// Blur ratio that lenses usually have.
inline constexpr double kUsualBlurRatio = 0.45;

// chi^2 of a blur ratio. Lenses have 0.45 within 25 % (less above, where 0.5 is the whole
// aperture), and the slope is good to 15 %. The result is very large where the ratio is not
// positive.
double ChiSquareOfRatio(double blur_ratio);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_BLUR_SLOPE_H_
