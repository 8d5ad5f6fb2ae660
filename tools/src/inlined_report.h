#ifndef THICKLENS_TOOLS_INLINED_REPORT_H_
#define THICKLENS_TOOLS_INLINED_REPORT_H_

#include <string>

namespace thicklens::tools {

// What stands in <main> of a page of `thicklens calibrate --report`, to be put into another page
// that has the style of SvgPlotStyle: headings one level lower, every id and reference to one with
// "calibration-" in front. Only the elements and attributes that such a page has are accepted, and
// only if they are well-formed: nothing that a browser would run or load gets in. Throws Error that
// begins with `name`.
std::string InlinedCalibrationReport(const std::string& html, const std::string& name);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_INLINED_REPORT_H_
