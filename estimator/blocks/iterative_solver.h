#ifndef THICKLENS_ESTIMATOR_BLOCKS_ITERATIVE_SOLVER_H_
#define THICKLENS_ESTIMATOR_BLOCKS_ITERATIVE_SOLVER_H_

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "estimator/blocks/linear_solver.h"

namespace thicklens::estimator {

// A library's iterations toward A x = b, with the library's own idea of when they are done.
class IterativeMethod {
 public:
  virtual ~IterativeMethod() = default;
  // Bytes it keeps of a matrix, beside a few vectors.
  virtual double BytesOf(const kernels::CsrMatrix<double>& matrix) const = 0;
  virtual void SetMatrix(const kernels::CsrMatrix<double>& matrix) = 0;
  virtual std::string device() const { return {}; }  // as LinearSolver's
  // From x = 0 until the residual is `tolerance` of |b|, or `max_iterations` are done; adds those
  // that were to `iterations`.
  virtual std::vector<double> Run(const std::vector<double>& b, double tolerance,
                                  int max_iterations, int* iterations) = 0;
};

// Does not believe a method when it says that it is done: recomputes the residual, and has it
// iterate on what is left, until the residual is as small as asked for, the limit of iterations is
// reached, or nothing gets better any more: what it leaves is never worse than its start. (Eigen's
// BiCGSTAB reports success always, and ViennaCL's BiCGStab leaves before the update that made the
// residual small.)
class IterativeSolver : public LinearSolver {
 public:
  IterativeSolver(std::unique_ptr<IterativeMethod> method, const IterationLimits& limits);

  double PredictBytes(const kernels::CsrMatrix<double>& matrix) override;
  void Factorize(const kernels::CsrMatrix<double>& matrix) override;
  std::optional<double> rcond() const override { return std::nullopt; }
  std::vector<double> Solve(const std::vector<double>& b) override;
  std::vector<double> SolveFrom(std::vector<double> start, const std::vector<double>& b) override;
  int iterations() const override { return iterations_; }
  std::string device() const override { return method_->device(); }

 private:
  std::unique_ptr<IterativeMethod> method_;
  IterationLimits limits_;
  kernels::CsrMatrix<double> matrix_;
  int iterations_ = 0;
};

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLOCKS_ITERATIVE_SOLVER_H_
