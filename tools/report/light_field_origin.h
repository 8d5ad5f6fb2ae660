#ifndef THICKLENS_TOOLS_REPORT_LIGHT_FIELD_ORIGIN_H_
#define THICKLENS_TOOLS_REPORT_LIGHT_FIELD_ORIGIN_H_

#include <string>

#include "tools/report/light_field_page.h"

namespace thicklens::tools {

// Returns whether the light field was estimated from a photograph; simulated and imported ones were
// not.
bool IsEstimated(const LightFieldPageInput& input);

// "7 × 7", "1 view", "49 views", with spaces that do not break.
std::string Times(int a, int b);
std::string Counted(int count, const std::string& what);

// The origin of the light field: one sentence, and a table (HTML) of everything that is known of
// it.
std::string RunInWords(const LightFieldPageInput& input);
std::string HowItWasMade(const LightFieldPageInput& input);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_LIGHT_FIELD_ORIGIN_H_
