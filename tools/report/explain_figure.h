#ifndef THICKLENS_TOOLS_REPORT_EXPLAIN_FIGURE_H_
#define THICKLENS_TOOLS_REPORT_EXPLAIN_FIGURE_H_

#include <string>

#include "thicklens/model/explanation.h"

namespace thicklens::tools {

// Draws the curve of blur against depth as an SVG file, with the band of two standard errors from
// the errors of d1 and kappa. A wide range of depths is drawn against 1/depth.
std::string BlurCurveSvg(const model::Camera& camera, const model::DepthRange& range);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_EXPLAIN_FIGURE_H_
