#ifndef THICKLENS_TOOLS_REPORT_ABLATION_PAGE_H_
#define THICKLENS_TOOLS_REPORT_ABLATION_PAGE_H_

#include <string>

#include "thicklens/base/output_file.h"
#include "thicklens/simulate.h"
#include "tools/report/ablation_table.h"

namespace thicklens::tools {

// Makes one self-contained HTML page: the table, and an image of what each effect changes.
std::string AblationPage(const Ablation& ablation, const std::string& name,
                         const std::string& version, const std::string& date);

// Writes kAblationPage and kAblationTable into a folder; `name` says what was simulated.
void WriteAblation(const Ablation& ablation, const std::string& name, OutputFolder* folder);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_ABLATION_PAGE_H_
