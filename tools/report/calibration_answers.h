#ifndef THICKLENS_TOOLS_REPORT_CALIBRATION_ANSWERS_H_
#define THICKLENS_TOOLS_REPORT_CALIBRATION_ANSWERS_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/error_budget.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/next_measurement.h"

namespace thicklens::tools {

// The answers of a calibration, in the order in which they are asked for: where is focus, what is
// the blur, can I trust it, what is the largest error, what next.
struct CalibrationAnswers {
  std::string focus, blur, trust, error, next;  // one line each; empty: there is nothing to say
};
CalibrationAnswers AnswersOf(const calib::FocusSweep& sweep, const calib::Calibration& calibration);

// The numbers of frames: "131 frames: 74 used, 31 rejected, 26 left out".
std::string FrameCountText(const calib::Calibration& calibration);

// Reasons for which frames are left out, with their numbers, one line each.
std::vector<std::string> LeftOutLines(const calib::Calibration& calibration);

// The error of one term in all results: "zf +-1.9 mm, d1 +-0.0090 mm, kappa +-0.030".
std::string TermErrors(const calib::ErrorTerm& term);

// The terms of the error, and the proposed measurement, for JSON.
nlohmann::json ErrorTermsJson(const std::vector<calib::ErrorTerm>& terms);
nlohmann::json NextMeasurementJson(const calib::NextMeasurement& next);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_CALIBRATION_ANSWERS_H_
