#include "bench_solvers.h"

#include "interrupt.h"
#include "thicklens/estimator/functional_solver.h"
#include "thicklens/estimator/grid_solver.h"
#include "thicklens/estimator/scene_solver.h"

namespace thicklens::tools {
namespace {

using estimator::EstimateInput;

void StopWhenAsked(int /*done*/, int /*total*/) { ThrowIfInterrupted(); }

}  // namespace

LightFieldSolver SolverByBlocks(estimator::BlockSolver solver, int threads,
                                kernels::Backend* backend) {
  estimator::BlockOptions options;
  options.solver = solver;
  options.block_px = kSourceBlockPx;
  options.threads = threads;
  options.progress = StopWhenAsked;
  return {"blocks", estimator::BlockSolverName(solver), "ridge",
          [options, backend](const EstimateInput& input) {
            estimator::EstimateSummary summary;
            return estimator::EstimateByBlocks(input, options, backend, &summary);
          }};
}

std::vector<LightFieldSolver> WholePictureSolvers(int threads) {
  std::vector<LightFieldSolver> solvers;
  for (const auto prior : {estimator::Prior::kRidge, estimator::Prior::kGradient,
                           estimator::Prior::kTotalVariation, estimator::Prior::kPatches}) {
    estimator::SceneOptions options;
    options.prior = prior;
    options.threads = threads;
    options.progress = StopWhenAsked;
    solvers.push_back({"scene", "", estimator::PriorName(prior), [options](const auto& input) {
                         estimator::SceneSummary summary;
                         return estimator::EstimateScene(input, options, &summary, nullptr);
                       }});
  }
  estimator::FunctionalOptions functional;
  functional.threads = threads;
  functional.progress = StopWhenAsked;
  for (const bool on_grid : {false, true}) {
    solvers.push_back({on_grid ? "grid" : "functional", "", "ridge",
                       [functional, on_grid](const EstimateInput& input) {
                         const auto estimate =
                             on_grid ? estimator::EstimateOnGrid : estimator::EstimateFunctional;
                         estimator::FunctionalSummary summary;
                         return estimate(input, functional, &summary);
                       }});
  }
  solvers.push_back({"dibr", "", "", [threads](const EstimateInput& input) {
                       return estimator::WarpedLightField(input, true, threads);
                     }});
  return solvers;
}

}  // namespace thicklens::tools
