#ifndef THICKLENS_ESTIMATOR_BLOCKS_ITERATIVE_SOLVER_H_
#define THICKLENS_ESTIMATOR_BLOCKS_ITERATIVE_SOLVER_H_

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "estimator/blocks/linear_solver.h"

namespace thicklens::estimator {

// The iterations of a library toward A x = b, with the library's own stopping rule.
class IterativeMethod {
 public:
  virtual ~IterativeMethod() = default;
  // Bytes that the method keeps for a matrix, besides a few vectors.
  virtual double BytesOf(const kernels::CsrMatrix<double>& matrix) const = 0;
  virtual void SetMatrix(const kernels::CsrMatrix<double>& matrix) = 0;
  virtual std::string device() const { return {}; }  // as LinearSolver::device
  // Iterates from x = 0 until the residual is `tolerance` times |b| or `max_iterations` are done.
  // Adds the number of iterations to `iterations`.
  virtual std::vector<double> Run(const std::vector<double>& b, double tolerance,
                                  int max_iterations, int* iterations) = 0;
};

// Recomputes the residual instead of relying on the stopping rule of the method, and lets the
// method iterate on the remaining residual, until the residual is as small as requested, the limit
// of iterations is reached, or nothing improves. The result is never worse than the start. (Eigen's
// BiCGSTAB always reports success, and ViennaCL's BiCGStab returns before the update that made the
// residual small.)
class IterativeSolver : public LinearSolver {
 public:
  IterativeSolver(std::unique_ptr<IterativeMethod> method, const LinearSolverLimits& limits);

  double PredictBytes(const kernels::CsrMatrix<double>& matrix) override;
  void Factorize(const kernels::CsrMatrix<double>& matrix) override;
  std::optional<double> rcond() const override { return std::nullopt; }
  std::vector<double> Solve(const std::vector<double>& b) override;
  std::vector<double> SolveFrom(std::vector<double> start, const std::vector<double>& b) override;
  int iterations() const override { return iterations_; }
  std::string device() const override { return method_->device(); }

 private:
  std::unique_ptr<IterativeMethod> method_;
  LinearSolverLimits limits_;
  kernels::CsrMatrix<double> matrix_;
  int iterations_ = 0;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLOCKS_ITERATIVE_SOLVER_H_
