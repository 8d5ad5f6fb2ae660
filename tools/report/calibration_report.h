#ifndef THICKLENS_TOOLS_REPORT_CALIBRATION_REPORT_H_
#define THICKLENS_TOOLS_REPORT_CALIBRATION_REPORT_H_

#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/sweep_file.h"
#include "tools/report/calibration_sections.h"
#include "tools/report/sweep_imaging.h"

namespace thicklens::tools {

// The origin of the report, as far as the measurement does not know it.
struct ReportOrigin {
  std::string sweep_name;          // file or folder, as the user gave it
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
  // One self-contained page without network access or scripts; its figures are inline SVG, and its
  // images are inline too. It is well-formed XML.
  std::string html;
  std::vector<ReportFile> figures;  // the same figures as SVG files
  std::string captions;             // plain text: the file and the content of each figure
};

// `truth` and `imaging` may be null and `images` empty. Figures without data are left out.
CalibrationReport MakeCalibrationReport(const calib::FocusSweep& sweep,
                                        const calib::Calibration& calibration,
                                        const model::SweepTruth* truth, const ReportOrigin& origin,
                                        const FrameImages& images = {},
                                        const SweepImaging* imaging = nullptr);

// Names that figures of a report can have.
std::vector<std::string> ReportFigureNames();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_CALIBRATION_REPORT_H_
