#ifndef THICKLENS_TOOLS_ESTIMATE_PLAN_H_
#define THICKLENS_TOOLS_ESTIMATE_PLAN_H_

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "estimate_options.h"
#include "thicklens/estimator/estimate_input.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/light_field.h"

namespace thicklens::tools {

// One way to a light field: all that `estimate` lets a person choose about how, but not about what.
struct EstimatePlan {
  std::string solver = "scene";
  std::string prior;                // of scene; else empty
  std::string block_solver;         // of blocks; else empty
  std::optional<double> tolerance;  // absent: the solver's own
  bool double_precision = false;
  std::optional<int> block_px;
  bool on_opencl = false;
};

// Unique, as a person would type it: "scene tv", "scene tv, tolerance 0.01", "blocks umfpack 16
// px".
std::string PlanName(const EstimatePlan& plan);
nlohmann::json PlanJson(const EstimatePlan& plan);
// Throws Error that begins with `where` and names the field.
EstimatePlan PlanFromJson(const nlohmann::json& json, const std::string& where);
// The options of a command line that asks for it: word by word, and as one text.
std::vector<std::string> PlanWords(const EstimatePlan& plan);
std::string PlanArguments(const EstimatePlan& plan);
void ApplyPlan(const EstimatePlan& plan, EstimateOptions* options);

// What a solver says of a run of it, whatever solver it is.
struct PlanRun {
  model::LightField light_field;
  double setup_seconds = 0, solve_seconds = 0, views_seconds = 0;
  double seconds() const { return setup_seconds + solve_seconds + views_seconds; }
  std::optional<int> iterations;  // absent: a direct solver
  bool converged = true;
  std::optional<double> relative_residual;  // recomputed from the answer
  std::optional<double> rcond;              // of direct solvers
  std::string device;                       // of blocks and scene
};
// All that is given is taken as it is; fall-off where there is a camera. `backend`: where the plan
// is to be computed. Stopped by an interrupt.
PlanRun RunPlan(const EstimatePlan& plan, const estimator::EstimateInput& input, int threads,
                kernels::Backend* backend);
// Of the baseline: the picture warped by its depth.
PlanRun RunWarping(const estimator::EstimateInput& input, int threads);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_ESTIMATE_PLAN_H_
