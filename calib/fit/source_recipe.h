#ifndef THICKLENS_CALIB_FIT_SOURCE_RECIPE_H_
#define THICKLENS_CALIB_FIT_SOURCE_RECIPE_H_

#include <vector>

#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

// Runs the recipe of the supplement, section 5 [D68]: the sharpest raw frame of `used` is taken as
// the plane of focus, and kappa is the mean of sigma/r_defocus. Erratum of the paper: the sharpest
// raw frame is not the plane of focus (lamp, magnification and floor shift it), and frames near
// focus dominate the mean of ratios. The frames must have depths, indices and Zhuo-Sim sigmas.
SourceRecipe RunSourceRecipe(const model::Camera& camera,
                             const std::vector<FrameMeasurement>& frames,
                             const std::vector<std::size_t>& used);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_SOURCE_RECIPE_H_
