#ifndef THICKLENS_CALIB_FIT_BLUR_PREDICTION_H_
#define THICKLENS_CALIB_FIT_BLUR_PREDICTION_H_

#include <Eigen/Core>

#include "calib/fit/blur_fit.h"

namespace thicklens::calib {

// V of a frame by the blur law, px^2 of the target and without the estimator's c, with its
// derivatives.
struct BlurPrediction {
  double value = 0;
  Eigen::Vector4d by_global{0, 0, 0, 0};  // derivatives in the order of BlurParameter
  double by_depth = 0, by_depth_twice = 0;
};

// `global` is in the order of BlurParameter. `depth_mm` already includes its bench offset.
BlurPrediction PredictBlur(const BlurFitSetup& setup, const Eigen::Vector4d& global,
                           double depth_mm, double scale);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_PREDICTION_H_
