#include <Eigen/IterativeLinearSolvers>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <vector>

#include "estimator/blocks/iterative_solver.h"
#include "estimator/blocks/linear_solver_kinds.h"

namespace thicklens::estimator {
namespace {

using kernels::CsrMatrix;
// Rows first, because the products of the iterations run through the rows.
using RowMatrix = Eigen::SparseMatrix<double, Eigen::RowMajor, std::int64_t>;

template <typename Iterations>
class EigenMethod : public IterativeMethod {
 public:
  double BytesOf(const CsrMatrix<double>& matrix) const override {
    constexpr double kPerEntry = sizeof(double) + sizeof(std::int64_t);
    return kPerEntry * static_cast<double>(matrix.entries());
  }

  void SetMatrix(const CsrMatrix<double>& matrix) override {
    const std::vector<std::int64_t> index(matrix.column.begin(), matrix.column.end());
    matrix_ =
        Eigen::Map<const RowMatrix>(matrix.rows, matrix.columns, matrix.entries(),
                                    matrix.row_start.data(), index.data(), matrix.value.data());
    solver_.compute(matrix_);
  }

  std::vector<double> Run(const std::vector<double>& b, double tolerance, int max_iterations,
                          int* iterations) override {
    solver_.setTolerance(tolerance);
    solver_.setMaxIterations(max_iterations);
    const Eigen::VectorXd x =
        solver_.solve(Eigen::Map<const Eigen::VectorXd>(b.data(), matrix_.rows()));
    // Each pass counts at least one iteration, so that a method that does nothing cannot run
    // forever.
    *iterations += std::max(1, static_cast<int>(solver_.iterations()));
    return {x.data(), x.data() + x.size()};
  }

 private:
  RowMatrix matrix_;
  Iterations solver_;
};

}  // namespace

std::unique_ptr<LinearSolver> NewEigenCgSolver(const LinearSolverLimits& limits) {
  using Cg = Eigen::ConjugateGradient<RowMatrix, Eigen::Lower | Eigen::Upper>;
  return std::make_unique<IterativeSolver>(std::make_unique<EigenMethod<Cg>>(), limits);
}

std::unique_ptr<LinearSolver> NewEigenBicgstabSolver(const LinearSolverLimits& limits) {
  using Bicgstab = Eigen::BiCGSTAB<RowMatrix>;
  return std::make_unique<IterativeSolver>(std::make_unique<EigenMethod<Bicgstab>>(), limits);
}

}  // namespace thicklens::estimator
