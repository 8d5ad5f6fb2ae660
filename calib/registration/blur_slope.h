#ifndef THICKLENS_CALIB_REGISTRATION_BLUR_SLOPE_H_
#define THICKLENS_CALIB_REGISTRATION_BLUR_SLOPE_H_

#include <optional>
#include <vector>

#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/image_scale.h"

namespace thicklens::calib {

// By how many px the sigma of the blur grows where the image scale changes by its own size, from
// the blurs that the registrations saw: good to some 15 %. No reading and no bench zero is in it,
// so that it holds whatever the readings are.
//
// Of frames of scale s against the sharpest (derived here, [D65]; p the pixel pitch, s near 1):
//   the target moves: sigma = kappa r K |1/z - 1/zf|/p = kappa r f1/(p (zf - f1)) |s - s0|, from
//     [S25], K = f1 zf/(zf - f1) and s = zf/z;
//   the lens or the sensor moves: sigma = kappa r |1 - D/D0|/p = kappa r/p |s - s0|, because the
//     size goes as D, the distance from the aperture to the sensor.
struct BlurSlope {
  double px = 0;

  // kappa if the target moves and is in focus at a depth; negative nearer than the focal point.
  double RatioOfMovingTarget(const model::Camera& camera, double focus_depth_mm) const;
  double RatioOfMovingLens(const model::Camera& camera) const;
};

// Nothing from fewer than five frames, or where the blur does not grow beyond its errors.
std::optional<BlurSlope> FindBlurSlope(const std::vector<ScaleSample>& samples);

// How unlikely a blur ratio is, as a chi^2: lenses have 0.45 within 25 % (less above, where 0.5
// is the whole aperture), and the slope is good to 15 %. Very large where it is not positive.
double ChiSquareOfRatio(double blur_ratio);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_REGISTRATION_BLUR_SLOPE_H_
