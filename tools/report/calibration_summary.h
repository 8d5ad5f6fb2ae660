#ifndef THICKLENS_TOOLS_REPORT_CALIBRATION_SUMMARY_H_
#define THICKLENS_TOOLS_REPORT_CALIBRATION_SUMMARY_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/sweep_file.h"
#include "tools/report/rounding.h"

namespace thicklens::tools {

// One calibrated quantity by every method that yields it.
struct ResultRow {
  std::string key;    // name in files: "image_distance_mm"
  std::string label;  // name for people: "image distance d1"
  std::string unit;   // "mm", "px"; empty for a ratio
  std::optional<calib::Result> fit;
  std::optional<double> source;       // the paper's recipe; it has no error estimate
  std::optional<calib::Result> peak;  // peak of the normalised sharpness
  std::optional<double> truth;
};
// The rows d1, zf, kappa, floor and bench offset. `truth` may be null.
std::vector<ResultRow> ResultRows(const calib::Calibration& calibration,
                                  const model::SweepTruth* truth);

// Returns the file name of a path in printable form.
std::string FrameName(const std::string& image);

// Returns the text that is printed after a calibration. `truth` may be null, and `camera_file` is
// empty if no camera file is written. It ends with a newline.
std::string CalibrationText(const calib::FocusSweep& sweep, const calib::Calibration& calibration,
                            const model::SweepTruth* truth, const std::string& camera_file = "");

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_CALIBRATION_SUMMARY_H_
