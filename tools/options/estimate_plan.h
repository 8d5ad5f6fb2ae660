#ifndef THICKLENS_TOOLS_OPTIONS_ESTIMATE_PLAN_H_
#define THICKLENS_TOOLS_OPTIONS_ESTIMATE_PLAN_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/estimator/estimate_input.h"
#include "thicklens/estimator/estimate_plan.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/light_field.h"
#include "tools/options/estimate_options.h"

namespace thicklens::tools {

nlohmann::json PlanJson(const estimator::EstimatePlan& plan);
// Throws Error that begins with `where` and names the field.
estimator::EstimatePlan PlanFromJson(const nlohmann::json& json, const std::string& where);
// Return the options of a command line for the plan: word by word, and as one text.
std::vector<std::string> PlanWords(const estimator::EstimatePlan& plan);
std::string PlanArguments(const estimator::EstimatePlan& plan);
void ApplyPlan(const estimator::EstimatePlan& plan, EstimateOptions* options);

// The report of a run of any solver.
struct PlanRun {
  model::LightField light_field;
  double setup_seconds = 0, solve_seconds = 0, views_seconds = 0;
  double seconds() const { return setup_seconds + solve_seconds + views_seconds; }
  std::optional<int> iterations;  // absent: a direct solver
  bool converged = true;
  std::optional<double> relative_residual;  // recomputed from the solution
  std::optional<double> rcond;              // direct solvers only
  std::string device;                       // solvers blocks and scene only
};
// Uses the plan as given; fall-off is applied if there is a camera. `backend` computes the plan;
// null: the processor. An interrupt stops it.
PlanRun RunPlan(const estimator::EstimatePlan& plan, const estimator::EstimateInput& input,
                int threads, kernels::Backend* backend);
// Runs the baseline: the photograph warped by its depth.
PlanRun RunWarping(const estimator::EstimateInput& input, int threads);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_ESTIMATE_PLAN_H_
