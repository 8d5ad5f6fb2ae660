#ifndef THICKLENS_TOOLS_ESTIMATE_SUMMARY_H_
#define THICKLENS_TOOLS_ESTIMATE_SUMMARY_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "blur_proposal.h"
#include "estimate_input.h"
#include "estimate_options.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/estimate_checks.h"
#include "thicklens/estimator/functional_solver.h"
#include "thicklens/estimator/inpaint.h"
#include "thicklens/estimator/ray_confidence.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/model/light_field.h"

namespace thicklens::tools {

struct EstimateSeconds {
  double read = 0;   // of the set-up: until a plan is chosen, and that
  double setup = 0;  // reading included
  double blur_check = 0;
  double solve = 0;
  double views = 0;  // making them; by blocks they are what is solved for
  double files = 0;  // writing them
  double total = 0;  // until the light field was written, a page not included
};

// What came out of a run. One of `scene`, `blocks` and `functional` is there.
struct EstimateOutcome {
  model::LightField light_field;
  std::optional<estimator::SceneSummary> scene;
  estimator::SceneMaps maps;  // of `scene`
  std::optional<estimator::EstimateSummary> blocks;
  std::optional<estimator::FunctionalSummary> functional;  // `grid`, too
  std::optional<BlurProposal> blur;                        // of `scene`, if it was asked for
  std::optional<estimator::InpaintSummary> inpainting;     // --fill telea
  EstimateSeconds seconds;
  double clipped_fraction = 0;             // of the values, by the views' files
  estimator::ConfidenceShares confidence;  // of all rays

  // What the estimate can know of itself.
  estimator::StepCheck steps;
  std::optional<double> depth_noise_px;       // of the map that was read
  std::optional<double> depth_noise_left_px;  // where it was smoothed
  std::vector<estimator::ResidualPatch> patches;
  std::optional<double> unexplained_share;  // of `scene`
};
// Sets the last four from the others.
void CheckOutcome(const PreparedEstimate& prepared, EstimateOutcome* outcome);

// What speaks against the result, one line each, with its number.
std::vector<std::string> EstimateWarnings(const EstimateOptions& options,
                                          const PreparedEstimate& prepared,
                                          const EstimateOutcome& outcome);

// What --json writes.
nlohmann::json EstimateJson(const EstimateOptions& options, const PreparedEstimate& prepared,
                            const EstimateOutcome& outcome);
// What is printed: the same for people. Ends with a newline.
std::string EstimateText(const PreparedEstimate& prepared, const EstimateOutcome& outcome,
                         const nlohmann::json& summary);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_ESTIMATE_SUMMARY_H_
