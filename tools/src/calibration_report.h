#ifndef THICKLENS_TOOLS_CALIBRATION_REPORT_H_
#define THICKLENS_TOOLS_CALIBRATION_REPORT_H_

#include <string>
#include <vector>

#include "calibration_sections.h"
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
  bool reading_sigma_stated = true;
};

struct ReportFile {
  std::string name;
  std::string content;
};

struct CalibrationReport {
  // One page that needs nothing else: no network, no script; its figures are inline SVG, its
  // pictures inline too. It is well-formed XML.
  std::string html;
  std::vector<ReportFile> figures;  // the same figures as SVG files
  std::string captions;             // plain text: which figure is which file, and what it shows
};

// `truth` may be null and `pictures` empty. Figures without data are left out.
CalibrationReport MakeCalibrationReport(const calib::FocusSweep& sweep,
                                        const calib::Calibration& calibration,
                                        const model::SweepTruth* truth, const ReportOrigin& origin,
                                        const FramePictures& pictures = {});

// The names that figures of a report can have.
std::vector<std::string> ReportFigureNames();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_CALIBRATION_REPORT_H_
