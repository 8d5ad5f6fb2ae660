#ifndef THICKLENS_CALIB_UNCERTAINTY_SYSTEMATIC_ADVICE_H_
#define THICKLENS_CALIB_UNCERTAINTY_SYSTEMATIC_ADVICE_H_

#include <string>
#include <vector>

#include "calib/fit/blur_fit.h"
#include "thicklens/calib/calibration.h"

namespace thicklens::calib {

// What the part is called that another shape of the blur makes; it moves kappa only where the
// stated shape is plain wrong.
inline constexpr const char* kShapePart = "shape of the blur";

// The largest part first; then the advice: what would shrink what takes the largest share of the
// error of d1, the statistical part at its 95 %, what the bench zero brings into it apart (nothing,
// where there is no zero). A wrong shape of the blur comes before all shares.
void SortAndAdvise(Calibration* calibration);

// Adds a part that moves zf by up to `move_mm` either way, to the table and to the intervals of zf
// and d1, linearly: these are no errors that average out.
void WidenFocus(const std::string& name, double move_mm, const std::string& remedy,
                const model::ThickLens& lens, Calibration* calibration);

// Adds a part by fitting again with each of `setups` in place of what was assumed, to the table and
// to the intervals of zf, d1, kappa and the bench zero.
void WidenByTrials(const std::string& name, const std::string& remedy,
                   const std::vector<BlurFitSetup>& setups, const BlurFitResult& fit,
                   Calibration* calibration);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_UNCERTAINTY_SYSTEMATIC_ADVICE_H_
