#ifndef THICKLENS_KERNELS_SEEN_ROW_H_
#define THICKLENS_KERNELS_SEEN_ROW_H_

#include "thicklens/base/export.h"

namespace thicklens::kernels {

// The rays of one view from a row of the centre view's points. The ray of a point of disparity d
// meets the view at its pixel less shift * d. No index of a pixel may exceed 2^31.
struct VisibleRow {
  int width_px, height_px, y;     // size of the view, px; index of the row
  float shift_x, shift_y;         // shift of the view, px per unit of disparity
  const float* points_disparity;  // disparity of the row
  const float* view_disparity;    // disparity of the view; NaN: hidden
  const unsigned char* known;     // flags of the row
  float same_surface, weight;     // allowed difference of disparities; weight of the view
};

// Adds the view's weight to the share of each point whose ray is not occluded: the ray is inside
// the view, to half a pixel, and one of the pixels around it has the disparity of the point, to
// `same_surface`; or the point's flag is set. The result is the same on every processor.
THICKLENS_EXPORT void AddVisible(const VisibleRow& row, float* share);

}  // namespace thicklens::kernels

#endif  // THICKLENS_KERNELS_SEEN_ROW_H_
