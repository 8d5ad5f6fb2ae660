#ifndef THICKLENS_ESTIMATOR_BLOCKS_LINEAR_SOLVER_H_
#define THICKLENS_ESTIMATOR_BLOCKS_LINEAR_SOLVER_H_

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/estimator/block_solver.h"
#include "thicklens/kernels/sparse.h"

namespace thicklens::estimator {

// When an iterative solver stops; a direct one has no use for it.
struct IterationLimits {
  double tolerance = 1e-6;    // of |b - A x|/|b|, > 0
  int max_iterations = 1000;  // for one right side, >= 1
};

// Prepares a square sparse matrix once (a direct solver factorises it) and solves with it often.
//
// An object is used by one thread at a time. Throws Error if memory is short or the library fails;
// a matrix that is singular, or not positive definite where it has to be, is no exception but has
// rcond 0, and iterations that do not converge leave what they have reached.
class LinearSolver {
 public:
  virtual ~LinearSolver() = default;

  // Bytes that Factorize will need at most beside the matrix: of a direct solver, from the fill of
  // the chosen ordering.
  virtual double PredictBytes(const kernels::CsrMatrix<double>& matrix) = 0;

  virtual void Factorize(const kernels::CsrMatrix<double>& matrix) = 0;
  // Smallest over largest pivot (squared diagonal of the Cholesky factor): about 1/condition, not a
  // bound. Of a general matrix without pivots at hand, 1/(|A|_1 est |A^-1|_1). Absent: an iterative
  // solver, which has no factor; nothing but the residual judges its answer.
  virtual std::optional<double> rcond() const = 0;
  // A x = b. Only after a Factorize whose rcond() is absent or above 0.
  virtual std::vector<double> Solve(const std::vector<double>& b) = 0;
  // The same from an answer that is near; a direct solver has no use for it.
  virtual std::vector<double> SolveFrom(std::vector<double> /*start*/,
                                        const std::vector<double>& b) {
    return Solve(b);
  }
  // Of the last Solve.
  virtual int iterations() const { return 0; }
  // Of its own, where it has one: for people. Empty: it computes where the caller does.
  virtual std::string device() const { return {}; }
};

// `symmetric` promises a symmetric positive definite matrix; CHOLMOD and conjugate gradients are
// for these alone (throws Error else). Throws Error if this build has no such solver.
std::unique_ptr<LinearSolver> NewLinearSolver(BlockSolver solver, bool symmetric,
                                              const IterationLimits& limits = {});

// |b - A x|/|b|, 2-norms; |b - A x| if b is 0.
double RelativeResidual(const kernels::CsrMatrix<double>& a, const std::vector<double>& x,
                        const std::vector<double>& b);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLOCKS_LINEAR_SOLVER_H_
