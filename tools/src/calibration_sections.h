#ifndef THICKLENS_TOOLS_CALIBRATION_SECTIONS_H_
#define THICKLENS_TOOLS_CALIBRATION_SECTIONS_H_

#include <cstddef>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "calibration_summary.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::tools {

// The parts of a calibration's page that are words and tables. Each is empty where there is nothing
// to say.

std::string VerdictSection(const calib::FocusSweep& sweep, const calib::Calibration& calibration);

// The results with both kinds of error; with a truth, the errors too.
std::string ResultsSection(const std::vector<ResultRow>& rows, bool has_truth);
// Each source of systematic error, largest first, what would shrink it, and the tolerances that are
// not stated. With a truth the camera's numbers are exact.
std::string SystematicSection(const calib::FocusSweep& sweep, const calib::Calibration& calibration,
                              bool has_truth);
// The depth of focus by everything else that tells it.
std::string OtherWaysSection(const calib::Calibration& calibration,
                             const std::vector<ResultRow>& rows);
// What the field map and the colours say, to stand below the map.
std::string FieldWords(const calib::Calibration& calibration);
std::string CorrelationSection(const calib::Calibration& calibration);

// The picture of a frame as its file stores it; an empty matrix where there is none.
using FramePictures = std::function<cv::Mat(std::size_t index)>;
// `pictures` may be empty: no thumbnails then.
std::string RejectedSection(const calib::FocusSweep& sweep, const calib::Calibration& calibration,
                            const FramePictures& pictures);

// What was typed in plain letters as a page has it: "+-" as ±, hyphens of numbers as minus signs,
// " .. " as an ellipsis, "chi2" as χ², " deg" as °.
std::string Typeset(const std::string& text);
// With a capital and a full stop.
std::string AsSentence(std::string text);
// With no-break spaces. Without a sigma it was not fitted: given, or taken for granted.
std::string WithSigma(const calib::Result& result);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_CALIBRATION_SECTIONS_H_
