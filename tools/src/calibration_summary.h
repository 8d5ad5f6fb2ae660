#ifndef THICKLENS_TOOLS_CALIBRATION_SUMMARY_H_
#define THICKLENS_TOOLS_CALIBRATION_SUMMARY_H_

#include <optional>
#include <string>
#include <vector>

#include "rounding.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::tools {

// One calibrated quantity by every method that gives it.
struct ResultRow {
  std::string key;    // as in files: "image_distance_mm"
  std::string label;  // as read: "image distance d1"
  std::string unit;   // "mm", "px"; empty for a ratio
  std::optional<calib::Result> fit;
  std::optional<double> source;       // the source's recipe; it has no error estimate
  std::optional<calib::Result> peak;  // of the normalised sharpness
  std::optional<double> truth;
};
// The rows d1, zf, kappa, floor and bench offset. `truth` may be null.
std::vector<ResultRow> ResultRows(const calib::Calibration& calibration,
                                  const model::SweepTruth* truth);

// The file's own name out of a path, printable.
std::string FrameName(const std::string& image);

// What is printed after a calibration. `truth` may be null. Ends with a newline.
std::string CalibrationText(const calib::FocusSweep& sweep, const calib::Calibration& calibration,
                            const model::SweepTruth* truth);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_CALIBRATION_SUMMARY_H_
