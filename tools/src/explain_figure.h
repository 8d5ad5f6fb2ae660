#ifndef THICKLENS_TOOLS_EXPLAIN_FIGURE_H_
#define THICKLENS_TOOLS_EXPLAIN_FIGURE_H_

#include <string>

#include "explain_table.h"

namespace thicklens::tools {

// The curve of blur against depth as an SVG file, with the band of two standard errors that the
// errors of d1 and kappa make. Where the depths go far, they are drawn by 1/depth.
std::string BlurCurveSvg(const model::Camera& camera, const DepthRange& range);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_EXPLAIN_FIGURE_H_
