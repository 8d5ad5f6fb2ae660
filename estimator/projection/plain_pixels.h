#ifndef THICKLENS_ESTIMATOR_PROJECTION_PLAIN_PIXELS_H_
#define THICKLENS_ESTIMATOR_PROJECTION_PLAIN_PIXELS_H_

#include <vector>

#include "thicklens/estimator/view_geometry.h"

namespace thicklens::estimator {

// Pixels around which the disparity changes so little that no ray has to be looked at.
struct PlainPixels {
  // The rays of the fan through a photograph's pixel all come from the surface around it, and the
  // product of the axes (view_fan.h) misplaces none by more than the tolerance.
  std::vector<unsigned char> is_product;
  // Every view sees the point of the centre view.
  std::vector<unsigned char> is_seen;
};

// By bounds, so that what is left out may be plain as well; what is said to be plain is. For a fan
// of u_count x v_count views, whose places are at most A and B px per unit of disparity from the
// centre. With D the largest disparity that can reach the pixel, and G, H the largest differences
// of neighbours across and down there: neighbouring points keep their order in all views where
// A G + B H < 1, since where a point is shown moves by less than the point does. The product reads
// the disparity of a point that is A D beside that of the ray, hence wrong by at most
//   e = A G D/(1 - B H)  (down),  then  f = H (1 + B e + C D)/(1 - A G)  (across, a row beside it),
// and misplaces the ray by at most B e and A f. C is 0, but for an even v_count half a view's step
// down: there the axis is the mean of the two views beside the middle, which read so far above and
// below. (Of an even u_count the two lie in the row itself, and e holds.) Derived here [D92].
// `tolerance_px` must be below 1.
PlainPixels FindPlainPixels(const DisparityMap& disparity, int u_count, int v_count,
                            double tolerance_px);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_PROJECTION_PLAIN_PIXELS_H_
