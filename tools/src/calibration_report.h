#ifndef THICKLENS_TOOLS_CALIBRATION_REPORT_H_
#define THICKLENS_TOOLS_CALIBRATION_REPORT_H_

#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::tools {

// What the report says of how it came about and the measurement does not know.
struct ReportOrigin {
  std::string sweep_name;          // file or folder, as the person gave it
  std::string version;             // of thicklens
  std::string date;                // ISO 8601
  std::vector<std::string> notes;  // one line each
};

// One page that needs nothing else: no network, no script; its figures are inline SVG. It is
// well-formed XML too. `truth` may be null. Figures without data are left out.
std::string CalibrationReportHtml(const calib::FocusSweep& sweep,
                                  const calib::Calibration& calibration,
                                  const model::SweepTruth* truth, const ReportOrigin& origin);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_CALIBRATION_REPORT_H_
