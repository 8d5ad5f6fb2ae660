#ifndef THICKLENS_TOOLS_REPORT_CALIBRATION_JSON_H_
#define THICKLENS_TOOLS_REPORT_CALIBRATION_JSON_H_

#include <nlohmann/json.hpp>

#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::tools {

// Returns the machine-readable summary, with every number of the report. `status`, `reason`,
// `method` and the results are always present, and so are `sharpest_reading`, `diagnoses` (the
// causes that were compared), `frame_structure`, `fixed_pattern`, `frame_light`, `stage_errors` and
// `camera_response` (null if they were not examined). A result that does not exist, a number that
// was not measured, and a number that is not finite is null. `scale_model`, `covariance`,
// `blur_fit`, `sides`, `field` and the entries of `other_methods` are present with `done: false` or
// null numbers if they were not reached. `truth` is left out if none is known.
//
// With `use_source_recipe` the results are those of the paper's recipe, with null sigma and with
// the recipe's own status and reason. The results of the fit are then in `other_methods.fit` alone,
// under their usual keys.
nlohmann::json CalibrationJson(const calib::FocusSweep& sweep,
                               const calib::Calibration& calibration,
                               const model::SweepTruth* truth, bool use_source_recipe);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_CALIBRATION_JSON_H_
