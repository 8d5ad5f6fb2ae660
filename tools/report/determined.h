#ifndef THICKLENS_TOOLS_REPORT_DETERMINED_H_
#define THICKLENS_TOOLS_REPORT_DETERMINED_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "thicklens/calib/calibrate.h"

namespace thicklens::tools {

// Findings of a sweep that hold even if its calibration is refused: the sharpest frame, the
// position of focus, the change of the image scale, and the causes of a symptom that were compared.
// Each is one line without a newline, with "+-" and "-" in plain characters.

// "reading 110.03 +- 0.11 mm, by 5 frames; frame_015.png is the sharpest", or why there is none.
std::string SharpestLine(const calib::Calibration& calibration);
// "by the image scale; magnification at focus 1.000 +- 0.017"; empty if nothing determines the
// bench offset, or if the calibration is refused.
std::string OffsetOriginLine(const calib::Calibration& calibration);
// "1/scale changes by +10.1 +- 0.1 % over the sweep: the target looks smaller at larger readings";
// empty if it was not measured.
std::string ScaleChangeLine(const calib::ScaleModel& scale);
// "the image scale against the readings: the target moves as stated (chi2 31); then ...": one line
// for each comparison.
std::vector<std::string> DiagnosisLines(const calib::Calibration& calibration);
// "structure fixed to the frame was found and removed: 25 specks (dust; ...": what was removed from
// the frames; empty if nothing was.
std::string PatternLine(const calib::FixedPattern& pattern);
// "the light is the value as read to the power 1.002 +- 0.004; weak detail loses -0.1 +- 0.2 %":
// what the frames show of the camera's transfer and processing; empty if they show nothing.
std::string ResponseLine(const calib::CameraResponse& response);

// The findings as JSON; null if nothing was measured.
nlohmann::json SharpestJson(const calib::Calibration& calibration);
nlohmann::json DiagnosesJson(const calib::Calibration& calibration);
nlohmann::json StructureJson(const calib::FrameStructureFinding& structure);
nlohmann::json PatternJson(const calib::FixedPattern& pattern);
nlohmann::json StageJson(const calib::StageErrors& stage);
// Bands, exposure and white balance that change from frame to frame.
nlohmann::json LightJson(const calib::FrameLight& light);
nlohmann::json ResponseJson(const calib::CameraResponse& response);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_DETERMINED_H_
