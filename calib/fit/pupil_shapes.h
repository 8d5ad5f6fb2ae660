#ifndef THICKLENS_CALIB_FIT_PUPIL_SHAPES_H_
#define THICKLENS_CALIB_FIT_PUPIL_SHAPES_H_

#include <Eigen/Core>

#include "thicklens/model/pupil_law.h"

namespace thicklens::calib {

// Shape of a blur with constant second moment under the known pupil laws: the smallest and the
// largest value over the laws, including the uniform one.

// The tails of RelativeBlur: (c4 - c4 of the uniform law)/24, where c4 is the excess kurtosis of
// the blur per axis. Derived here [D80]: ln H = -u + c4 (4 u^2)/24 + .. with u = x^2/2,
// x = 2 pi sigma nu.
Eigen::Vector2d TailsOfPupilLaws(const model::PupilOptics& optics);

// The sigma of the uniform law's edge profile that is nearest to the law's in the mean square, over
// the law's own sigma. This is the result of a fit of edges with the family.
Eigen::Vector2d EdgeRatiosOfPupilLaws(const model::PupilOptics& optics);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_PUPIL_SHAPES_H_
