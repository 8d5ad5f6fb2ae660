#ifndef THICKLENS_MODEL_TARGET_TEXTURE_H_
#define THICKLENS_MODEL_TARGET_TEXTURE_H_

#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/target_page.h"

namespace thicklens::model {

// One disc of the texture.
struct TargetLeaf {
  double x_mm = 0, y_mm = 0;  // on the sheet
  double radius_mm = 0;       // radius, mm
  int grey = 0;               // 0 to 255, as stored
};

// The texture of a target: dead leaves, discs that occlude each other, from the back to the front.
// The radii are distributed as r^-3, so that every octave of sizes takes the same part of the area:
// whatever the blur, some of the texture stays visible, and nothing repeats. Occluded leaves are
// left out. The same page gives the same leaves on every machine.
THICKLENS_EXPORT std::vector<TargetLeaf> DeadLeaves(const TargetPage& page);

// The grey value where no leaf lies, on less than a thousandth of the area.
THICKLENS_EXPORT int GreyBehindLeaves(const TargetPage& page);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_TARGET_TEXTURE_H_
