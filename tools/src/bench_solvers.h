#ifndef THICKLENS_TOOLS_BENCH_SOLVERS_H_
#define THICKLENS_TOOLS_BENCH_SOLVERS_H_

#include <functional>
#include <string>
#include <vector>

#include "estimate_plan.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/light_field.h"

namespace thicklens::tools {

// By blocks of the source's size, with its gamma of 1.
EstimatePlan SourcePlan(estimator::BlockSolver solver);
// Of the whole picture: scene with each prior, functional, grid.
std::vector<EstimatePlan> WholePicturePlans();

// One way from picture and depth to the views, all of it, stopped by an interrupt.
struct LightFieldSolver {
  std::string solver, block_solver, prior;  // empty: it has none
  std::function<model::LightField(const estimator::EstimateInput&)> estimate;
};
// Keeps `backend`.
LightFieldSolver SolverByBlocks(estimator::BlockSolver solver, int threads,
                                kernels::Backend* backend);
// Those of WholePicturePlans(), and at last the baseline dibr.
std::vector<LightFieldSolver> WholePictureSolvers(int threads);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_SOLVERS_H_
