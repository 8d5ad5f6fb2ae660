#ifndef THICKLENS_TOOLS_LIGHT_FIELD_ORIGIN_H_
#define THICKLENS_TOOLS_LIGHT_FIELD_ORIGIN_H_

#include <string>

#include "light_field_page.h"

namespace thicklens::tools {

// Whether the light field comes from a photograph; simulated and imported ones do not.
bool IsEstimated(const LightFieldPageInput& input);

// "7 × 7", "1 view", "49 views", with spaces that do not break.
std::string Times(int a, int b);
std::string Counted(int count, const std::string& what);

// How the light field was made: one sentence, and a table (HTML) of all that is known of it.
std::string RunInWords(const LightFieldPageInput& input);
std::string HowItWasMade(const LightFieldPageInput& input);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_LIGHT_FIELD_ORIGIN_H_
