#ifndef THICKLENS_ESTIMATOR_PROJECTION_VISIBLE_FRACTION_H_
#define THICKLENS_ESTIMATOR_PROJECTION_VISIBLE_FRACTION_H_

#include <vector>

#include "estimator/projection/angular_bundle.h"
#include "thicklens/estimator/disparity_map.h"

namespace thicklens::estimator {

// Returns the share of the aperture, by its weights, that sees each point p of the centre view
// through the photograph. The ray of the view (a, b) meets the photograph at p - D (a, b). The ray
// sees the point if the disparity rendered into that view is the point's at one of the pixels
// around (a surface's edge may run between them). Rays that miss the photograph by more than half a
// pixel see nothing. `disparity` is the bundle's. Points with `known` set are visible to all views
// and are not examined.
std::vector<float> VisibleFraction(const AngularBundle& bundle, const DisparityMap& disparity,
                                   const std::vector<unsigned char>& known, int threads);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_PROJECTION_VISIBLE_FRACTION_H_
