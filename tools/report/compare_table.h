#ifndef THICKLENS_TOOLS_REPORT_COMPARE_TABLE_H_
#define THICKLENS_TOOLS_REPORT_COMPARE_TABLE_H_

#include <nlohmann/json.hpp>
#include <string>

#include "thicklens/compare.h"

namespace thicklens::tools {

// Equal images have an infinite PSNR: texts say "identical"; JSON, which has no infinity, has null
// and `identical: true`. A score that is not defined is "-" in texts and null in JSON.
std::string ImageScoresText(const ImageScores& scores, int border_px);
nlohmann::json ImageScoresJson(const ImageScores& scores);

// Number of views whose PSNR is above that of DIBR; 0 without DIBR.
int ViewsAboveDibr(const LightFieldScores& scores);

// `per_view` adds a line for each view.
std::string LightFieldScoresText(const LightFieldScores& scores, int border_px, bool per_view);
// Without DIBR its keys are null.
nlohmann::json LightFieldScoresJson(const LightFieldScores& scores, int border_px);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_COMPARE_TABLE_H_
