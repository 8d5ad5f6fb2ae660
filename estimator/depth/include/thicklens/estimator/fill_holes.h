#ifndef THICKLENS_ESTIMATOR_FILL_HOLES_H_
#define THICKLENS_ESTIMATOR_FILL_HOLES_H_

#include <cstddef>
#include <limits>

#include "thicklens/base/export.h"
#include "thicklens/estimator/disparity_map.h"
#include "thicklens/model/scene.h"

namespace thicklens::estimator {

// Fills the holes (NaN) of a map along the surfaces around them, never between two surfaces.
//
// Each pixel is assigned to one of the known pixels around the hole: the one with the shortest path
// that crosses no edges of the image. Where the image does not decide, the pixel is assigned to the
// farther surface, because depth sensors lose values beside near objects.
//
// Inside one surface, the plane through it, fitted with allowance for its noise, is bent to meet
// the rims. The more and the larger the holes are, the closer to the rims the bending is confined.
// Neighbours belong to two surfaces where their disparities differ by more than six times the map's
// noise, but at least 0.2 and at most 1 px per view step.
//
// The image `image` must have the size of the map. `filled` (may be null) receives the number of
// filled pixels. No filled value is below both the smallest known value and `at_infinity`, the
// disparity of an infinitely far point, where that is known. Throws Error if all values are holes,
// the sizes differ, or a value of the image is not finite.
THICKLENS_EXPORT DisparityMap
FillHoles(const DisparityMap& map, const model::LinearImage& image, std::size_t* filled,
          double at_infinity = -std::numeric_limits<double>::infinity());

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_FILL_HOLES_H_
