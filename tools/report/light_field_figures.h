#ifndef THICKLENS_TOOLS_REPORT_LIGHT_FIELD_FIGURES_H_
#define THICKLENS_TOOLS_REPORT_LIGHT_FIELD_FIGURES_H_

#include <string>

#include "tools/report/light_field_page.h"

namespace thicklens::tools {

// The sections of the page about a light field that show images, each without its heading and empty
// if the input has nothing to show.
std::string SweepFigure(const LightFieldPageInput& input);
std::string ImageAndDepthFigure(const LightFieldPageInput& input);
std::string ViewFigures(const LightFieldPageInput& input);
std::string EpipolarFigure(const LightFieldPageInput& input);
std::string RefocusFigure(const LightFieldPageInput& input);

// The style rules of these figures.
std::string LightFieldFigureStyle();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_LIGHT_FIELD_FIGURES_H_
