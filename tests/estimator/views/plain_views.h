#ifndef THICKLENS_TESTS_ESTIMATOR_VIEWS_PLAIN_VIEWS_H_
#define THICKLENS_TESTS_ESTIMATOR_VIEWS_PLAIN_VIEWS_H_

#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator::testing {

// RenderDisparity and WarpImage as one would write them down, in double and one sample after the
// other.
ViewDisparity PlainView(const DisparityMap& map, double a, double b);
model::LinearImage PlainWarp(const model::LinearImage& image, const DisparityMap& map,
                             const ViewDisparity& view);

}  // namespace thicklens::estimator::testing

#endif  // THICKLENS_TESTS_ESTIMATOR_VIEWS_PLAIN_VIEWS_H_
