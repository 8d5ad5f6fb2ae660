#ifndef THICKLENS_ESTIMATOR_CONDITIONING_H_
#define THICKLENS_ESTIMATOR_CONDITIONING_H_

#include <optional>

#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/functional_solver.h"

namespace thicklens::estimator {

// How well a linear system can be solved, looked at densely: for small pictures, to show and to
// test, not to estimate with.
struct Conditioning {
  int unknowns = 0;
  // Of the eigenvalues; of the singular values where the matrix is not symmetric. The smallest is 0
  // or below where rounding decides it.
  double smallest = 0, largest = 0;
  // |x - x0|/|x0| of a dense Cholesky (LU where not symmetric) of the matrix, rounded to that
  // precision, with the right side A x0 of a random x0. Absent: the factorisation broke down.
  std::optional<double> float_error, double_error;

  // largest/smallest; infinite where the smallest is not above 0.
  double condition() const;
};

// Of the system of EstimateByBlocks, the whole picture being one block; gamma, ridge, stencil,
// splat and fall-off are taken from the options. Throws Error for more than 4000 unknowns (pixels
// times views), and for inputs that do not fit.
Conditioning ConditioningOfBlock(const EstimateInput& input, const BlockOptions& options);

// [D117] Of Id + H A^-1 H^T, the system of EstimateFunctional in scene-ray form, one unknown a
// pixel. Its smallest eigenvalue is at least 1, and the largest at most 1 + |H|^2/mu, because A is
// at least mu. For gamma toward infinity A^-1 tends to the mean over a point's rays over mu, and
// with mu' = U V mu the largest tends to 1 + |H1|^2/mu', H1 the photograph of points whose rays are
// equal.
Conditioning ConditioningOfSceneRays(const EstimateInput& input, const FunctionalOptions& options);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_CONDITIONING_H_
