#ifndef THICKLENS_TOOLS_ATTRIBUTION_PAGE_H_
#define THICKLENS_TOOLS_ATTRIBUTION_PAGE_H_

#include <string>

#include "attribution_table.h"
#include "commands.h"
#include "progress_line.h"
#include "thicklens/base/output_file.h"

namespace thicklens::tools {

// One HTML page, all of it in one file: the table, and what each effect changes as a picture.
std::string AttributionPage(const Attribution& attribution, const std::string& name,
                            const std::string& version, const std::string& date);

// A run that shows its progress and ends when the person asks for it.
AttributionRun AttributionRunWith(const CommonOptions& common, ProgressLine* progress);

// AttributeSweep of a simulation that was read from a file, which messages name.
SweepAttribution AttributeSweepOf(const std::string& path,
                                  const model::SweepSimulationOptions& sweep, bool unknown_offset,
                                  const AttributionRun& run);

// The page and the table for programs in a folder; `name` is what was simulated.
inline constexpr char kAttributionPage[] = "attribution.html";
inline constexpr char kAttributionTable[] = "attribution.csv";
void WriteAttribution(const Attribution& attribution, const std::string& name,
                      OutputFolder* folder);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_ATTRIBUTION_PAGE_H_
