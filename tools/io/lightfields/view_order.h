#ifndef THICKLENS_TOOLS_IO_LIGHTFIELDS_VIEW_ORDER_H_
#define THICKLENS_TOOLS_IO_LIGHTFIELDS_VIEW_ORDER_H_

#include <string>

#include "thicklens/model/light_field.h"

namespace thicklens::io {

// The order of the views, as the shifts between neighbouring views show it. A point at x in the
// view (k, l) is at x - (d, 0) in the view (k + 1, l) and at x - (0, d) in the view (k, l + 1),
// with the same disparity d: the first shift is horizontal, the second vertical, and both have one
// sign all over the image. If rows and columns are exchanged, the first is vertical and the second
// horizontal; if one of them counts backwards, the signs differ. If both count backwards, every
// disparity has the other sign, and a scene with the other depths has the same shifts: that cannot
// be decided here.
enum class ViewOrder {
  kUndecided,
  kAsStated,
  kSwapped,          // rows and columns are exchanged
  kMirrored,         // rows or columns count backwards
  kSwappedMirrored,  // both
  kIrregular,        // the shifts fit no order: the views are shuffled or not rectified
};
struct ViewOrderFinding {
  ViewOrder order = ViewOrder::kUndecided;
  std::string why;  // of kUndecided: the reason, a clause
  // There is one row or one column: whether it counts backwards is not decided.
  bool is_line = false;
  // Most disparities (the tenth to the ninetieth of a hundred), px per view step; 0 if undecided.
  double least_px = 0, most_px = 0;
  // Shift per step down relative to that per step across; 1 unless the shifts show another one.
  double step_ratio = 1;
};
// Compares views in the middle of a light field with their neighbours, and then all views with
// theirs: an order that only some of the steps between views have is undecided. Deterministic.
ViewOrderFinding FindViewOrder(const model::LightField& light_field);

}  // namespace thicklens::io

#endif  // THICKLENS_TOOLS_IO_LIGHTFIELDS_VIEW_ORDER_H_
