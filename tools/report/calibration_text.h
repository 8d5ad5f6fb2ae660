#ifndef THICKLENS_TOOLS_REPORT_CALIBRATION_TEXT_H_
#define THICKLENS_TOOLS_REPORT_CALIBRATION_TEXT_H_

#include <optional>
#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"

namespace thicklens::tools {

// The findings in words that text and page share. Each is one line without a newline, with "+-" and
// "-" in plain characters, and empty if there is nothing to say.

std::string ScaleKindName(calib::ScaleKind kind);  // name in JSON: "inverse-depth"
std::string ScaleKindWords(calib::ScaleKind kind);

// Tilt, curvature, astigmatism and depths of the field, one line each.
std::vector<std::string> FieldLines(const calib::FieldMap& field);
// The axial colour: each channel's in-focus object distance.
std::string ChannelLine(const std::vector<calib::ChannelFocus>& channels);
// In-focus object distance of the far side minus that of the near side; nothing unless both sides
// are done.
std::optional<model::Estimate> SidesApartMm(const calib::Calibration& calibration);
std::string SidesLine(const calib::Calibration& calibration);
// The point spread function that fits the frames better, and whether the camera file agrees.
std::string ShapeLine(const calib::FocusSweep& sweep, const calib::BlurFit& blur);
std::string MagnificationLine(const calib::Calibration& calibration);
std::string DistortionLine(const calib::ScaleModel& scale);
std::string OutsideLine(const calib::BlurFit& blur);
// An outcome in words, and its reason: "partly calibrated: the blur floor is not determined; the
// other results are in camera.yaml". `camera_file` is empty if none was written.
std::string OutcomeLine(const calib::Calibration& calibration, const std::string& camera_file);
// A text in which the keys of the results in files are replaced by their names in the results.
std::string WithNamesForKeys(std::string text);
// The combination of parameters with the largest error; empty if they are hardly correlated.
std::string WorstKnownLine(const calib::BlurFit& blur);
// Reports that the frames deviate from the law by more than their errors, if they do.
std::string WidenedLine(const calib::BlurFit& blur);

// Formats the (lowest, highest) range of one systematic part, with the digits of the larger: "-3.1
// .. +3.9".
std::string PartRange(const Eigen::Vector2d& range);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_CALIBRATION_TEXT_H_
