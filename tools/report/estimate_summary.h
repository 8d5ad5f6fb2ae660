#ifndef THICKLENS_TOOLS_REPORT_ESTIMATE_SUMMARY_H_
#define THICKLENS_TOOLS_REPORT_ESTIMATE_SUMMARY_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/estimate_checks.h"
#include "thicklens/estimator/functional_solver.h"
#include "thicklens/estimator/inpaint.h"
#include "thicklens/estimator/ray_confidence.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/model/light_field.h"
#include "tools/options/estimate_input.h"
#include "tools/options/estimate_options.h"
#include "tools/report/blur_proposal.h"

namespace thicklens::tools {

struct EstimateSeconds {
  double read = 0;   // part of the set-up until a plan is chosen, including the choice
  double setup = 0;  // reading included
  double blur_check = 0;
  double solve = 0;
  double views = 0;  // making the views; the solver of blocks solves for them
  double files = 0;  // writing the views
  double total = 0;  // until the light field was written, without a page
};

// The result of a run. Exactly one of `scene`, `blocks` and `functional` is present.
struct EstimateOutcome {
  model::LightField light_field;
  std::optional<estimator::SceneSummary> scene;
  estimator::SceneMaps maps;  // of solver scene
  std::optional<estimator::BlockSummary> blocks;
  std::optional<estimator::FunctionalSummary> functional;  // also of solver grid
  std::optional<BlurProposal> blur;                        // of solver scene, if requested
  std::optional<estimator::InpaintSummary> inpainting;     // --fill telea
  EstimateSeconds seconds;
  double clipped_fraction = 0;             // share of the values, by the views' files
  estimator::ConfidenceShares confidence;  // shares of all rays

  // Quality checks of the estimate.
  estimator::StepCheck steps;
  std::optional<double> depth_noise_px;       // of the map that was read
  std::optional<double> depth_noise_left_px;  // present if the map was smoothed
  std::vector<estimator::ResidualPatch> patches;
  std::optional<double> unexplained_share;  // of solver scene
};
// Sets the last four fields from the others.
void CheckOutcome(const PreparedEstimate& prepared, EstimateOutcome* outcome);

// Returns the warnings about the result, one line each, with their numbers.
std::vector<std::string> EstimateWarnings(const EstimateOptions& options,
                                          const PreparedEstimate& prepared,
                                          const EstimateOutcome& outcome);

// Returns what --json writes.
nlohmann::json EstimateJson(const EstimateOptions& options, const PreparedEstimate& prepared,
                            const EstimateOutcome& outcome);
// Returns the summary as text for people. It ends with a newline.
std::string EstimateText(const PreparedEstimate& prepared, const EstimateOutcome& outcome,
                         const nlohmann::json& summary);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_REPORT_ESTIMATE_SUMMARY_H_
