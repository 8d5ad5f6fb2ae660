#ifndef THICKLENS_TOOLS_BENCH_BENCH_SOLVERS_H_
#define THICKLENS_TOOLS_BENCH_BENCH_SOLVERS_H_

#include <functional>
#include <string>
#include <vector>

#include "thicklens/estimator/block_solver.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/light_field.h"
#include "tools/options/estimate_plan.h"

namespace thicklens::tools {

// Returns the plan by blocks of the paper's size, with its gamma of 1.
estimator::EstimatePlan SourcePlan(estimator::BlockSolver solver);
// Returns the plans for the whole image: scene with each prior, functional, grid.
std::vector<estimator::EstimatePlan> WholeImagePlans();

// One complete way from photograph and depth to the views. An interrupt stops it.
struct LightFieldSolver {
  std::string solver, block_solver, prior;  // empty: not applicable
  std::function<model::LightField(const estimator::EstimateInput&)> estimate;
};
// The result keeps `backend`.
LightFieldSolver SolverByBlocks(estimator::BlockSolver solver, int threads,
                                kernels::Backend* backend);
// Returns the solvers of WholeImagePlans(), followed by the baseline DIBR.
std::vector<LightFieldSolver> WholeImageSolvers(int threads);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_BENCH_SOLVERS_H_
