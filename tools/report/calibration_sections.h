#ifndef THICKLENS_TOOLS_REPORT_CALIBRATION_SECTIONS_H_
#define THICKLENS_TOOLS_REPORT_CALIBRATION_SECTIONS_H_

#include <cstddef>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "tools/report/calibration_summary.h"

namespace thicklens::tools {

// The sections of a calibration's page that consist of text and tables. A section without content
// is an empty string.

std::string VerdictSection(const calib::FocusSweep& sweep, const calib::Calibration& calibration);

// The results with both kinds of error, and with the true errors if there is a truth.
std::string ResultsSection(const std::vector<ResultRow>& rows, bool has_truth);
// Each source of error, statistical or systematic, the largest first, with what would reduce it,
// and the tolerances that are not stated. With a truth the camera's numbers are exact.
std::string SystematicSection(const calib::FocusSweep& sweep, const calib::Calibration& calibration,
                              bool has_truth);
// The in-focus object distance by every other method that measures it.
std::string OtherWaysSection(const calib::Calibration& calibration,
                             const std::vector<ResultRow>& rows);
// Text on the field map and the colours, shown below the map.
std::string FieldWords(const calib::Calibration& calibration);
std::string CorrelationSection(const calib::Calibration& calibration);

// Returns the image of a frame as its file stores it; an empty matrix if there is none.
using FrameImages = std::function<cv::Mat(std::size_t index)>;
// `images` may be empty; there are then no thumbnails.
std::string RejectedSection(const calib::FocusSweep& sweep, const calib::Calibration& calibration,
                            const FrameImages& images);

// Replaces plain characters by typographic ones: "+-" by ±, hyphens of numbers by minus signs, " ..
// " by an ellipsis, "chi2" by χ², " deg" by °.
std::string Typeset(const std::string& text);
// Adds a capital and a full stop.
std::string AsSentence(std::string text);
// Returns the value with its sigma and no-break spaces. A result without a sigma was not fitted: it
// was given or assumed.
std::string WithSigma(const calib::Result& result);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_CALIBRATION_SECTIONS_H_
