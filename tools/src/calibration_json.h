#ifndef THICKLENS_TOOLS_CALIBRATION_JSON_H_
#define THICKLENS_TOOLS_CALIBRATION_JSON_H_

#include <nlohmann/json.hpp>

#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::tools {

// The machine-readable summary, with every number that stands in the report. `status`, `reason`,
// `method` and the results are always there, and so are `sharpest_reading`, `diagnoses` (the causes
// that were compared) and `frame_structure` (null where it was not looked for); a result that does
// not exist, a number that was not measured, and every number that is not finite, is null.
// `scale_law`, `covariance`, `blur_fit`, `sides`, `field` and the entries of `other_methods` are
// there with `done: false` or null numbers if they were not reached; `truth` is left out where none
// is known.
//
// With `use_source_recipe` the results are the source's, their sigma null, status and reason its
// own; what the fit found is then in `other_methods.fit` alone, under the keys that it has else.
nlohmann::json CalibrationJson(const calib::FocusSweep& sweep,
                               const calib::Calibration& calibration,
                               const model::SweepTruth* truth, bool use_source_recipe);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_CALIBRATION_JSON_H_
