#ifndef THICKLENS_CALIB_FIT_PUPIL_SHAPES_H_
#define THICKLENS_CALIB_FIT_PUPIL_SHAPES_H_

#include <Eigen/Core>

#include "thicklens/model/pupil_law.h"

namespace thicklens::calib {

// What the known pupil laws make of the shape of a blur whose second moment is held: the least and
// the largest over the laws, the uniform one included.

// The tails of RelativeBlur: (c4 - c4 of the uniform law)/24, c4 the excess kurtosis of the blur
// per axis. Derived here [D80]: ln H = -u + c4 (4 u^2)/24 + .. with u = x^2/2, x = 2 pi sigma nu.
Eigen::Vector2d TailsOfPupilLaws(const model::PupilOptics& optics);

// The sigma of the uniform law's edge profile that comes nearest to the law's in the mean square,
// over the law's own sigma: what a fit of edges with the family finds.
Eigen::Vector2d EdgeRatiosOfPupilLaws(const model::PupilOptics& optics);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_PUPIL_SHAPES_H_
