#ifndef THICKLENS_TOOLS_REPORT_ESTIMATE_SUMMARY_H_
#define THICKLENS_TOOLS_REPORT_ESTIMATE_SUMMARY_H_

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "thicklens/estimate.h"
#include "tools/options/estimate_options.h"

namespace thicklens::tools {

// An estimate of the interface with what its command adds.
struct EstimateOutcome {
  LightFieldEstimate estimate;
  double read_seconds = 0;      // reading the files
  double files_seconds = 0;     // writing the views
  double total_seconds = 0;     // until the light field was written, without a page
  double clipped_fraction = 0;  // share of the values, by the views' files
  std::shared_ptr<const io::ImageFacts> photo_facts;  // what was read as the photograph
  std::string embedded_depth;  // the depth map inside it, in one line; empty: DEPTH was given
};

// "gaussian (from the camera), views of LF": the aperture in words.
std::string ApertureInWords(const EstimateOptions& options, const EstimateDiagnostics& found);
// How much of the predicted blur the photograph shows, in words; empty: it was stated.
std::string BlurShownInWords(const EstimateDiagnostics& found);

// Returns what --json writes.
nlohmann::json EstimateJson(const EstimateOptions& options, const EstimateOutcome& outcome);
// Returns the summary as text for people. It ends with a newline.
std::string EstimateText(const EstimateOptions& options, const EstimateOutcome& outcome,
                         const nlohmann::json& summary);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_ESTIMATE_SUMMARY_H_
