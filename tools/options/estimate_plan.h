#ifndef THICKLENS_TOOLS_OPTIONS_ESTIMATE_PLAN_H_
#define THICKLENS_TOOLS_OPTIONS_ESTIMATE_PLAN_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/estimator/estimate_input.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/light_field.h"
#include "tools/options/estimate_options.h"

namespace thicklens::tools {

// One way to a light field: the options of `estimate` that determine how it is computed, not what.
struct EstimatePlan {
  std::string solver = "scene";
  std::string prior;                // solver scene only; otherwise empty
  std::string block_solver;         // solver blocks only; otherwise empty
  std::optional<double> tolerance;  // absent: the solver's default
  bool double_precision = false;
  std::optional<int> block_px;
  bool on_opencl = false;
};

// Returns a unique name, as a user would type it: "scene tv", "scene tv, tolerance 0.01", "blocks
// umfpack 16 px".
std::string PlanName(const EstimatePlan& plan);
nlohmann::json PlanJson(const EstimatePlan& plan);
// Throws Error that begins with `where` and names the field.
EstimatePlan PlanFromJson(const nlohmann::json& json, const std::string& where);
// Return the options of a command line for the plan: word by word, and as one text.
std::vector<std::string> PlanWords(const EstimatePlan& plan);
std::string PlanArguments(const EstimatePlan& plan);
void ApplyPlan(const EstimatePlan& plan, EstimateOptions* options);

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
// Uses the plan as given; fall-off is applied if there is a camera. `backend` computes the plan. An
// interrupt stops it.
PlanRun RunPlan(const EstimatePlan& plan, const estimator::EstimateInput& input, int threads,
                kernels::Backend* backend);
// Runs the baseline: the photograph warped by its depth.
PlanRun RunWarping(const estimator::EstimateInput& input, int threads);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_OPTIONS_ESTIMATE_PLAN_H_
