#ifndef THICKLENS_TOOLS_REPORT_FOCUS_LIMITS_H_
#define THICKLENS_TOOLS_REPORT_FOCUS_LIMITS_H_

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "thicklens/model/depth_of_field.h"

namespace thicklens::tools {

// The depth of field for a circle of confusion, as `explain` and `calibrate` report it.

// One line for each quantity, without a newline, with "+-" in plain characters.
std::vector<std::string> FocusLimitsLines(const model::FocusLimits& limits);
nlohmann::json FocusLimitsJson(const model::FocusLimits& limits);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_FOCUS_LIMITS_H_
