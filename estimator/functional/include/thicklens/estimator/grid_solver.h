#ifndef THICKLENS_ESTIMATOR_GRID_SOLVER_H_
#define THICKLENS_ESTIMATOR_GRID_SOLVER_H_

#include "thicklens/estimator/estimate_input.h"
#include "thicklens/estimator/functional_solver.h"

namespace thicklens::estimator {

// The light field of one picture by the functional of EstimateByBlocks on the same two-plane grid
// and with the same H, D (in the warp form) and L0, but for the whole picture: the minimiser of
//   |H L - I|^2 + gamma |D L|^2 + mu |L - L0|^2
// over all rays that land on the picture, by conjugate gradients on
//   (H^T H + gamma D^T D + mu Id) L = H^T I + mu L0  [D113]
// from L0 on, without a matrix. As one block of the picture's size would do, it loses no link but
// those that leave the picture, and keeps L0 where rays land outside of it. The eigenvalues lie
// between mu and about 8 gamma + 1 + mu, so that small ridges take many iterations:
// EstimateFunctional solves what is nearly the same in far fewer.
// summary->relative_residual is that of this system. Throws Error for options and inputs that do
// not fit and a memory limit that is too low. The result does not depend on the number of threads.
model::LightField EstimateOnGrid(const EstimateInput& input, const FunctionalOptions& options,
                                 FunctionalSummary* summary);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_GRID_SOLVER_H_
