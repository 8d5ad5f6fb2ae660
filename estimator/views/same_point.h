#ifndef THICKLENS_ESTIMATOR_VIEWS_SAME_POINT_H_
#define THICKLENS_ESTIMATOR_VIEWS_SAME_POINT_H_

#include <vector>

#include "thicklens/estimator/disparity_map.h"

namespace thicklens::estimator {

// Returns whether a view shows, at (s, t) between its samples, a point of that disparity: every tap
// of the bilinear neighbourhood that has weight agrees to 0.3 px per view step. `of_view` is the
// disparity rendered into the view, with the size and unit of `map`. Returns false outside of the
// view.
bool ShowsSamePoint(const DisparityMap& map, const std::vector<float>& of_view, double s, double t,
                    double disparity);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_VIEWS_SAME_POINT_H_
