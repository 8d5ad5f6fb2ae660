#ifndef THICKLENS_ESTIMATOR_CONDITIONING_H_
#define THICKLENS_ESTIMATOR_CONDITIONING_H_

#include <optional>

#include "thicklens/base/export.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/functional_solver.h"

namespace thicklens::estimator {

// Conditioning of a linear system, computed from its dense matrix: for small images, to show and to
// test, not to estimate with.
struct Conditioning {
  int unknowns = 0;  // number of rows of the matrix
  // Extreme eigenvalues; extreme singular values if the matrix is not symmetric. `smallest` is 0 or
  // below where rounding decides it.
  double smallest = 0, largest = 0;
  // |x - x0|/|x0| for the dense Cholesky factorisation (LU if the matrix is not symmetric) of the
  // matrix rounded to that precision, with the right-hand side A x0 of a random x0. Absent if the
  // factorisation broke down.
  std::optional<double> float_error, double_error;

  // largest/smallest; infinite if `smallest` is not above 0.
  THICKLENS_EXPORT double condition() const;
};

// Conditioning of the system of EstimateByBlocks with the whole image as one block. The options
// give gamma, ridge, stencil, splat and fall-off. Throws Error for more than 4000 unknowns (pixels
// times views), and for options and inputs that do not fit.
THICKLENS_EXPORT Conditioning ConditioningOfBlock(const EstimateInput& input,
                                                  const BlockOptions& options);

// Conditioning of Id + H A^-1 H^T, the system of EstimateFunctional in scene-ray form, with one
// unknown for each pixel [D117]. Its smallest eigenvalue is at least 1, and its largest is at most
// 1 + |H|^2/mu because A is at least mu. As gamma goes to infinity, A^-1 tends to the mean over the
// rays of a point, divided by mu. With mu' = U V mu the largest eigenvalue then tends to 1 +
// |H1|^2/mu', where H1 forms the photograph of points whose rays are equal. Throws Error for more
// than 4000 pixels, and for options and inputs that do not fit.
THICKLENS_EXPORT Conditioning ConditioningOfSceneRays(const EstimateInput& input,
                                                      const FunctionalOptions& options);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_CONDITIONING_H_
