#ifndef THICKLENS_TESTS_ESTIMATOR_PLAIN_RAYS_H_
#define THICKLENS_TESTS_ESTIMATOR_PLAIN_RAYS_H_

#include <Eigen/Dense>
#include <cstddef>

#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator::testing {

// What the view (a, b) shows of a picture, as a matrix: bilinear at each sample's source, of the
// pixels within .3 px per view step of its disparity, else the closest of these.
Eigen::MatrixXd ViewMatrix(const DisparityMap& map, double a, double b);

// From planes R(., k), one after the other, to the photograph: ViewMatrix of each, weighted.
Eigen::MatrixXd PhotographMatrix(const DisparityMap& map, const Eigen::ArrayXXd& weights);

}  // namespace thicklens::estimator::testing

#endif  // THICKLENS_TESTS_ESTIMATOR_PLAIN_RAYS_H_
