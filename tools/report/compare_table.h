#ifndef THICKLENS_TOOLS_REPORT_COMPARE_TABLE_H_
#define THICKLENS_TOOLS_REPORT_COMPARE_TABLE_H_

#include <nlohmann/json.hpp>
#include <string>

#include "thicklens/estimator/compare.h"
#include "thicklens/model/light_field.h"

namespace thicklens::tools {

// Equal images have an infinite PSNR: texts say "identical"; JSON, which has no infinity, has null
// and `identical: true`. A score that is not defined is "-" in texts and null in JSON.
std::string ImageScoresText(const estimator::ImageScores& scores, int border_px);
nlohmann::json ImageScoresJson(const estimator::ImageScores& scores);

// Number of views whose PSNR is above that of DIBR; 0 without DIBR.
int ViewsAboveDibr(const estimator::LightFieldScores& scores);

// `reference` gives counts and sizes; `per_view` adds a line for each view.
std::string LightFieldScoresText(const estimator::LightFieldScores& scores,
                                 const model::LightField& reference, int border_px, bool per_view);
// Without DIBR its keys are null.
nlohmann::json LightFieldScoresJson(const estimator::LightFieldScores& scores,
                                    const model::LightField& reference, int border_px);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_COMPARE_TABLE_H_
