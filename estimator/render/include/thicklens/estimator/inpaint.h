#ifndef THICKLENS_ESTIMATOR_INPAINT_H_
#define THICKLENS_ESTIMATOR_INPAINT_H_

#include <cstddef>
#include <functional>
#include <string>

#include "thicklens/estimator/view_geometry.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {

struct InpaintOptions {
  double radius_px = 3;  // > 0: of the neighbourhood that Telea's method looks at
  int threads = 0;       // 0: one per core
  // Called as views are visited. May throw to stop; the light field is then filled in part.
  std::function<void(int done, int total)> progress;

  bool IsValid(std::string* why) const;
};

struct InpaintSummary {
  std::string message = "not run";
  std::size_t holes = 0;    // rays that pass something the centre view does not show
  std::size_t filled = 0;   // of these, by the method, in their own view
  std::size_t carried = 0;  // from the view in which their point was filled
  int views_visited = 0;    // in which there were holes left to fill
  double seconds = 0;
};

// The supplement's section 6 [D99], in place of what the solver put where near things hide the
// background from the centre view: view by view, holes are filled by Telea's method (fast marching)
// [L16], and the radiance of each point filled is carried along m to the holes of the other views
// that show it, until no hole is left or all views are visited. The order (from the centre outward)
// and the rule of carrying are ours: a point goes to the nearest sample x - (a' - a) disparity of
// the view a' if that is a hole whose background has the same disparity to .2 px per view step. The
// method looks at radiance, each channel on its own.
//
// Holes are samples that nothing of the centre view covers; those that show what lies beyond its
// border are none: there is nothing around them to go on. `map`: of the centre view, without holes.
// Views that are not present are left out. Throws Error for options and sizes that do not fit.
void InpaintHiddenRays(const DisparityMap& map, const InpaintOptions& options,
                       model::LightField* light_field, InpaintSummary* summary);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_INPAINT_H_
