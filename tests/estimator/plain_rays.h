#ifndef THICKLENS_TESTS_ESTIMATOR_PLAIN_RAYS_H_
#define THICKLENS_TESTS_ESTIMATOR_PLAIN_RAYS_H_

#include <Eigen/Dense>
#include <cstddef>

#include "thicklens/estimator/disparity_map.h"

namespace thicklens::estimator::testing {

// The matrix that maps an image to the view (a, b): bilinear at each sample's source, from the
// pixels within 0.3 px per view step of its disparity, or otherwise from the closest of these.
Eigen::MatrixXd ViewMatrix(const DisparityMap& map, double a, double b);

// Maps planes R(., k), one after the other, to the photograph: the weighted ViewMatrix of each
// plane.
Eigen::MatrixXd PhotographMatrix(const DisparityMap& map, const Eigen::ArrayXXd& weights);

}  // namespace thicklens::estimator::testing

#endif  // THICKLENS_TESTS_ESTIMATOR_PLAIN_RAYS_H_
