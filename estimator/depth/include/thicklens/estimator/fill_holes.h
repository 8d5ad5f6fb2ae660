#ifndef THICKLENS_ESTIMATOR_FILL_HOLES_H_
#define THICKLENS_ESTIMATOR_FILL_HOLES_H_

#include <cstddef>
#include <limits>

#include "thicklens/estimator/view_geometry.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// Holes (NaN) filled along the surfaces around them, never between two. Each pixel goes with one of
// the known pixels around the hole, that to which the shortest way leads without crossing edges of
// the picture; where the picture does not tell, with the farther surface, since depth sensors are
// blind beside near things. Inside of one surface the plane through it, fitted with its noise in
// mind, is bent to meet its rims (the more and the larger the holes are, the nearer to the rims
// alone); neighbours belong to two surfaces where their disparities differ by more than six times
// the map's noise, at least .2, at most 1 px per view step. `picture` shows what the map is the
// depth of. `filled` (may be null) is told how many. No hole is filled with less than
// `at_infinity`, the disparity of what is infinitely far, where that is known. Throws Error if all
// are holes or the sizes differ.
DisparityMap FillHoles(const DisparityMap& map, const model::LinearPicture& picture,
                       std::size_t* filled,
                       double at_infinity = -std::numeric_limits<double>::infinity());

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_FILL_HOLES_H_
