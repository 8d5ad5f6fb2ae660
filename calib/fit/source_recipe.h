#ifndef THICKLENS_CALIB_FIT_SOURCE_RECIPE_H_
#define THICKLENS_CALIB_FIT_SOURCE_RECIPE_H_

#include <vector>

#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

// Supplement, section 5 [D68]: the sharpest raw frame of `used` is taken for the plane of focus,
// kappa is the mean of sigma/r_defocus. Erratum of the source: the sharpest raw frame is not the
// plane of focus (lamp, magnification and floor pull it), and the mean of ratios is dominated by
// frames near focus. Needs the frames' depths, indices and Zhuo-Sim sigmas.
SourceRecipe RunSourceRecipe(const model::Camera& camera,
                             const std::vector<FrameMeasurement>& frames,
                             const std::vector<std::size_t>& used);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_SOURCE_RECIPE_H_
