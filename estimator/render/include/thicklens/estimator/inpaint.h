#ifndef THICKLENS_ESTIMATOR_INPAINT_H_
#define THICKLENS_ESTIMATOR_INPAINT_H_

#include <cstddef>
#include <string>

#include "thicklens/base/export.h"
#include "thicklens/base/progress.h"
#include "thicklens/estimator/disparity_map.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {

// How InpaintOccludedRays fills holes.
struct InpaintOptions {
  double radius_px = 3;  // radius of the neighbourhood that Telea's method uses, > 0
  int threads = 0;       // 0: one per core
  // Called for each visited view. If it throws, the light field is partly filled.
  ProgressFunction progress;

  // Returns whether all members are in their range. Otherwise `why`, if not null, gets the reason.
  THICKLENS_EXPORT bool IsValid(std::string* why) const;
};

// What InpaintOccludedRays did.
struct InpaintSummary {
  std::string message = "not run";  // how it ended, one line
  std::size_t holes = 0;    // occluded rays: they show something that the centre view does not
  std::size_t filled = 0;   // holes that the method filled in their own view
  std::size_t carried = 0;  // holes filled from the view in which their point was filled
  int views_visited = 0;    // views that still had holes to fill
  double seconds = 0;       // time of the inpainting
};

// Inpaints occluded background as in section 6 of the supplement [D99]. It replaces what the solver
// estimated where near objects occlude the background from the centre view. View by view, holes are
// filled by Telea's method (fast marching) [L16]. The radiance of each filled point is then carried
// along m to the holes of the other views that show it, until no hole is left or all views are
// visited. The method works on radiance, each channel on its own.
//
// The order (from the centre outward) and the rule of carrying are defined here: a point goes to
// the nearest sample x - (a' - a) disparity of the view a' if that sample is a hole whose
// background has the same disparity within 0.2 px per view step.
//
// Holes are samples that no point of the centre view covers. Samples that show something beyond the
// border of the centre view are not holes, because they have no surroundings to continue from.
// `map` belongs to the centre view and has no holes. Absent views are left out. Throws Error for
// options and sizes that do not fit, and for an invalid light field.
THICKLENS_EXPORT void InpaintOccludedRays(const DisparityMap& map, const InpaintOptions& options,
                                          model::LightField* light_field, InpaintSummary* summary);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_INPAINT_H_
