#ifndef THICKLENS_TOOLS_REPORT_TARGET_WORDS_H_
#define THICKLENS_TOOLS_REPORT_TARGET_WORDS_H_

#include <nlohmann/json.hpp>
#include <string>

#include "thicklens/calib/target_finding.h"

namespace thicklens::tools {

// "measured as points: 48 of 50 bright points, 1320 measurements; left out: 80 at the border ...":
// what was measured on the target; empty if nothing was.
std::string TargetLine(const calib::TargetFinding& target);
// JSON of the same findings, with the zones of a relief.
nlohmann::json TargetJson(const calib::TargetFinding& target);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_TARGET_WORDS_H_
