#ifndef THICKLENS_ESTIMATOR_SOLVE_H_
#define THICKLENS_ESTIMATOR_SOLVE_H_

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/estimate_input.h"
#include "thicklens/estimator/functional_solver.h"
#include "thicklens/estimator/grid_solver.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/estimator/solver_run.h"
#include "thicklens/model/light_field.h"

namespace thicklens::estimator {

// One interface to all solvers of this module. The type of the options selects the solver.
using SolverOptions = std::variant<SceneOptions, BlockOptions, FunctionalOptions, GridOptions>;

THICKLENS_EXPORT std::string SolverName(
    const SolverOptions& options);  // "scene", "blocks", "functional", "grid"
// Returns false, and the field, its value and the constraint in `why` (may be null), if a member of
// the options is not in its range. NaN and infinities never are.
THICKLENS_EXPORT bool IsValid(const SolverOptions& options, std::string* why);

// Findings that one solver alone has. std::monostate: no solver has run.
using SolverDiagnostics =
    std::variant<std::monostate, SceneDiagnostics, BlockDiagnostics, FunctionalDiagnostics>;

// How the estimate ended, for every solver in one form.
struct SolverSummary : SolverResult {
  std::string solver;               // its SolverName
  std::optional<int> iterations;    // the maximum over the parts; absent: a direct solver
  std::optional<double> rcond_min;  // the minimum over the blocks of a direct solver
  SolverDiagnostics diagnostics;    // what this solver alone reports
  std::vector<BlockReport> blocks;  // block solver only; row by row
};

// Estimates the light field of one photograph by the solver of the options: by EstimateScene,
// EstimateByBlocks, EstimateFunctional or EstimateOnGrid, bit for bit. `summary` may be null.
// `maps`, of the scene solver only, may be null.
//
// Throws Error, which names the solver, for options, a run, maps and a problem that do not fit, and
// for what the solver refuses. Throws Interrupted if the token of the thread's CancelScope was
// cancelled.
THICKLENS_EXPORT model::LightField Solve(const EstimateInput& problem, const SolverOptions& options,
                                         const SolverRun& run, SolverSummary* summary,
                                         SceneMaps* maps = nullptr);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_SOLVE_H_
