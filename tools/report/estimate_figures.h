#ifndef THICKLENS_TOOLS_REPORT_ESTIMATE_FIGURES_H_
#define THICKLENS_TOOLS_REPORT_ESTIMATE_FIGURES_H_

#include <string>

#include "tools/report/light_field_page.h"

namespace thicklens::tools {

// The sections of the page that show the estimate's own quality maps, each without its heading and
// empty if the input has no maps.
std::string ResidualFigure(const LightFieldPageInput& input);
std::string ConfidenceFigure(const LightFieldPageInput& input);

// All views in one image.
std::string MosaicFigure(const LightFieldPageInput& input);

// The style rules of these figures.
std::string EstimateFigureStyle();

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_ESTIMATE_FIGURES_H_
