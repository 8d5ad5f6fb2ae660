#ifndef THICKLENS_ESTIMATOR_BLOCKS_LINEAR_SOLVER_H_
#define THICKLENS_ESTIMATOR_BLOCKS_LINEAR_SOLVER_H_

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/estimator/block_solver.h"
#include "thicklens/kernels/sparse.h"

namespace thicklens::estimator {

// Stopping rule of an iterative solver; a direct solver does not use it.
struct LinearSolverLimits {
  double tolerance = 1e-6;    // limit of |b - A x|/|b|, > 0
  int max_iterations = 1000;  // for one right-hand side, >= 1
};

// Prepares a square sparse matrix once (a direct solver factorises it) and solves with it many
// times.
//
// One thread at a time uses an object. Throws Error if memory is short or the library fails. A
// matrix that is singular, or not positive definite where it must be, is no exception but has an
// rcond of 0. Iterations that do not converge leave what they have reached.
class LinearSolver {
 public:
  virtual ~LinearSolver() = default;

  // Upper bound of the bytes that Factorize needs besides the matrix; for a direct solver it
  // follows from the fill of the chosen ordering.
  virtual double PredictBytes(const kernels::CsrMatrix<double>& matrix) = 0;

  virtual void Factorize(const kernels::CsrMatrix<double>& matrix) = 0;
  // Smallest over largest pivot (squared diagonal of the Cholesky factor): about 1/condition, not a
  // bound. For a general matrix whose pivots are not accessible: 1/(|A|_1 est |A^-1|_1). Absent for
  // an iterative solver, which has no factor; the residual alone judges its solution.
  virtual std::optional<double> rcond() const = 0;
  // Solves A x = b. Call it only after a Factorize whose rcond() is absent or above 0.
  virtual std::vector<double> Solve(const std::vector<double>& b) = 0;
  // Solves A x = b from a nearby start; a direct solver ignores the start.
  virtual std::vector<double> SolveFrom(std::vector<double> /*start*/,
                                        const std::vector<double>& b) {
    return Solve(b);
  }
  // Iterations of the last Solve.
  virtual int iterations() const { return 0; }
  // Name of the solver's own device, for people to read. Empty if it computes where the caller
  // does.
  virtual std::string device() const { return {}; }
};

// `symmetric` promises a symmetric positive definite matrix. CHOLMOD and conjugate gradients need
// it: without it, this function throws Error for them. It also throws Error if this build has no
// such solver.
std::unique_ptr<LinearSolver> NewLinearSolver(BlockSolver solver, bool symmetric,
                                              const LinearSolverLimits& limits = {});

// Returns |b - A x|/|b| in 2-norms; |b - A x| if b is 0.
double RelativeResidual(const kernels::CsrMatrix<double>& a, const std::vector<double>& x,
                        const std::vector<double>& b);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLOCKS_LINEAR_SOLVER_H_
