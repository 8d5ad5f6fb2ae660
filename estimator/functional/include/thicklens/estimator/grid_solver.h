#ifndef THICKLENS_ESTIMATOR_GRID_SOLVER_H_
#define THICKLENS_ESTIMATOR_GRID_SOLVER_H_

#include "thicklens/base/export.h"
#include "thicklens/estimator/estimate_input.h"
#include "thicklens/estimator/functional_solver.h"

namespace thicklens::estimator {

// The options of EstimateOnGrid. They have a type of their own because the type selects the solver
// (SolverOptions).
struct GridOptions : WholeImageOptions {};

// Estimates the light field of one photograph with the functional of EstimateByBlocks, on the same
// two-plane grid and with the same H, D (in the warp form) and L0, but for the whole image at once.
// The solution minimises
//   |H L - I|^2 + gamma |D L|^2 + mu |L - L0|^2
// over all rays that land on the photograph. Conjugate gradients solve
//   (H^T H + gamma D^T D + mu Id) L = H^T I + mu L0  [D113]
// from L0 on, without a matrix. Like a single block of the photograph's size, the solver loses only
// the links that leave the photograph, and keeps L0 where rays land outside of it.
//
// The eigenvalues lie between mu and about 8 gamma + 1 + mu, so small ridges take many iterations;
// EstimateFunctional solves nearly the same problem in far fewer. summary->relative_residual is
// that of the system above.
//
// `summary` may be null. Throws Error for options and inputs that do not fit, for a memory limit
// that is too low, and for iterations that end with a relative residual of 10 or more. The result
// does not depend on the number of threads.
THICKLENS_EXPORT model::LightField EstimateOnGrid(const EstimateInput& input,
                                                  const GridOptions& options, const SolverRun& run,
                                                  FunctionalSummary* summary);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_GRID_SOLVER_H_
