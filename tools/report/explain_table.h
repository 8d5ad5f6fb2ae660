#ifndef THICKLENS_TOOLS_REPORT_EXPLAIN_TABLE_H_
#define THICKLENS_TOOLS_REPORT_EXPLAIN_TABLE_H_

#include <nlohmann/json.hpp>
#include <string>

#include "thicklens/model/explanation.h"

namespace thicklens::tools {

std::string ExplanationText(const model::Explanation& explanation);     // ends with a newline
nlohmann::json ExplanationJson(const model::Explanation& explanation);  // infinite depths are null

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_EXPLAIN_TABLE_H_
