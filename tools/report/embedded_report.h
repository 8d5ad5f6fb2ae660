#ifndef THICKLENS_TOOLS_REPORT_EMBEDDED_REPORT_H_
#define THICKLENS_TOOLS_REPORT_EMBEDDED_REPORT_H_

#include <string>

namespace thicklens::tools {

// Returns the content of <main> of a page of `thicklens calibrate --report`, for another page that
// has the style of SvgPlotStyle: headings are one level lower, and every id and reference to one
// gets the prefix "calibration-". Only the elements and attributes that such a page has are
// accepted, and only if they are well-formed, so nothing that a browser would run or load is
// included. Throws Error that begins with `name`.
std::string InlinedCalibrationReport(const std::string& html, const std::string& name);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_EMBEDDED_REPORT_H_
