#include "tools/bench/bench_solvers.h"

#include "thicklens/estimator/scene_solver.h"
#include "tools/bench/bench_parts.h"

namespace thicklens::tools {
namespace {

LightFieldSolver SolverOf(const estimator::EstimatePlan& plan, int threads,
                          kernels::Backend* backend) {
  return {plan.solver, plan.block_solver, plan.solver == "scene" ? plan.prior : "ridge",
          [plan, threads, backend](const estimator::EstimateInput& input) {
            return RunPlan(plan, input, threads, backend).light_field;
          }};
}

}  // namespace

estimator::EstimatePlan SourcePlan(estimator::BlockSolver solver) {
  estimator::EstimatePlan plan;
  plan.solver = "blocks";
  plan.block_solver = estimator::BlockSolverName(solver);
  plan.block_px = kSourceBlockPx;
  return plan;
}

std::vector<estimator::EstimatePlan> WholeImagePlans() {
  std::vector<estimator::EstimatePlan> plans;
  for (const auto prior : {estimator::Prior::kRidge, estimator::Prior::kGradient,
                           estimator::Prior::kTotalVariation, estimator::Prior::kPatches}) {
    estimator::EstimatePlan plan;
    plan.prior = estimator::PriorName(prior);
    plans.push_back(plan);
  }
  for (const char* solver : {"functional", "grid"}) {
    estimator::EstimatePlan plan;
    plan.solver = solver;
    plans.push_back(plan);
  }
  return plans;
}

LightFieldSolver SolverByBlocks(estimator::BlockSolver solver, int threads,
                                kernels::Backend* backend) {
  return SolverOf(SourcePlan(solver), threads, backend);
}

std::vector<LightFieldSolver> WholeImageSolvers(int threads) {
  std::vector<LightFieldSolver> solvers;
  for (const estimator::EstimatePlan& plan : WholeImagePlans()) {
    solvers.push_back(SolverOf(plan, threads, nullptr));
  }
  solvers.push_back({"dibr", "", "", [threads](const estimator::EstimateInput& input) {
                       return RunWarping(input, threads).light_field;
                     }});
  return solvers;
}

}  // namespace thicklens::tools
