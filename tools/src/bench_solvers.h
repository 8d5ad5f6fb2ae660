#ifndef THICKLENS_TOOLS_BENCH_SOLVERS_H_
#define THICKLENS_TOOLS_BENCH_SOLVERS_H_

#include <functional>
#include <string>
#include <vector>

#include "thicklens/estimator/estimate.h"
#include "thicklens/kernels/device.h"
#include "thicklens/model/light_field.h"

namespace thicklens::tools {

// One way from picture and depth to the views, all of it, stopped by an interrupt.
struct LightFieldSolver {
  std::string solver, block_solver, prior;  // empty: it has none
  std::function<model::LightField(const estimator::EstimateInput&)> estimate;
};

constexpr int kSourceBlockPx = 16;  // the source's

// By blocks of kSourceBlockPx with the source's gamma of 1; keeps `backend`.
LightFieldSolver SolverByBlocks(estimator::BlockSolver solver, int threads,
                                kernels::Backend* backend);
// scene with each prior, functional, grid, and at last the baseline dibr.
std::vector<LightFieldSolver> WholePictureSolvers(int threads);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_BENCH_SOLVERS_H_
