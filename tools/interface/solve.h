#ifndef THICKLENS_TOOLS_INTERFACE_SOLVE_H_
#define THICKLENS_TOOLS_INTERFACE_SOLVE_H_

#include <optional>
#include <vector>

#include "thicklens/estimate.h"
#include "thicklens/estimator/blur_check.h"
#include "thicklens/estimator/scene_solver.h"
#include "tools/interface/problem.h"
#include "tools/interface/run_scope.h"

namespace thicklens {

// The result of a solver, with the maps of SceneSolver.
struct Solved {
  LightField light_field;  // without values if the sink got the views
  SolverSummary summary;
  bool views_in_sink = false;
  bool is_scene = false;  // no views were made: radiance and confidence of the points are in `maps`
  std::optional<estimator::SceneMaps> maps;
  std::optional<estimator::BlurCheck> blur;
  std::vector<BlockRecord> blocks;
};

// Runs the solver of the options on the problem. Views go to `sink` (may be null) as they are made
// if the solver makes them one by one. `diagnostics` gets what it finds. A SolverChooser has been
// replaced before by what it chose.
Solved Solve(const PreparedProblem& prepared, const EstimateOptions& options, ViewSink* sink,
             EstimateDiagnostics* diagnostics, RunScope* run);

}  // namespace thicklens

#endif  // THICKLENS_TOOLS_INTERFACE_SOLVE_H_
