#ifndef THICKLENS_ESTIMATOR_PROJECTION_SEPARABLE_MASK_H_
#define THICKLENS_ESTIMATOR_PROJECTION_SEPARABLE_MASK_H_

#include <vector>

#include "thicklens/estimator/disparity_map.h"

namespace thicklens::estimator {

// Pixels around which the disparity changes so little that no ray has to be examined.
struct SeparableMask {
  // 1: the rays of the bundle through the photograph's pixel all come from the surface around it,
  // and the product of the axes (angular_bundle.h) misplaces none by more than the tolerance.
  std::vector<unsigned char> is_product;
  // 1: every view sees the point of the centre view.
  std::vector<unsigned char> is_visible;
};

// Finds plain pixels by bounds: every returned pixel is plain, but others may be plain as well. The
// bundle has u_count x v_count views, whose offsets from the centre are at most A and B px per unit
// of disparity.
//
// D is the largest disparity that can reach the pixel, and G, H are the largest differences of
// neighbours across and down there. Neighbouring points keep their order in all views where
// A G + B H < 1, because their images move by less than the points are apart. The product reads the
// disparity of a point that is A D beside that of the ray; this disparity is hence wrong by at most
//
//   e = A G D/(1 - B H)  (down),  then  f = H (1 + B e + C D)/(1 - A G)  (across, a row beside it),
//
// and the ray is misplaced by at most B e and A f. C is 0, except that for an even v_count it is
// half a view's step down: there the axis is the mean of the two views beside the middle, which
// read that far above and below. (For an even u_count the two views are in the row itself, and e
// holds.) Derived here [D92]. `tolerance_px` must be below 1.
SeparableMask FindSeparablePixels(const DisparityMap& disparity, int u_count, int v_count,
                                  double tolerance_px);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_PROJECTION_SEPARABLE_MASK_H_
