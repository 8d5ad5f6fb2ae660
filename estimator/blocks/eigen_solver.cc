#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <Eigen/SparseLU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "estimator/blocks/linear_solver_kinds.h"

namespace thicklens::estimator {
namespace {

using kernels::CsrMatrix;
using EigenMatrix = Eigen::SparseMatrix<double, Eigen::ColMajor, std::int64_t>;

// Returns the transpose: rows become columns.
EigenMatrix TransposedEigen(const CsrMatrix<double>& matrix) {
  std::vector<std::int64_t> index(matrix.column.begin(), matrix.column.end());
  return Eigen::Map<const EigenMatrix>(matrix.rows, matrix.columns, matrix.entries(),
                                       matrix.row_start.data(), index.data(), matrix.value.data());
}

std::vector<double> ToVector(const Eigen::VectorXd& x) { return {x.data(), x.data() + x.size()}; }

Eigen::Map<const Eigen::VectorXd> MapOf(const std::vector<double>& x) {
  return {x.data(), static_cast<Eigen::Index>(x.size())};
}

// Simplicial Cholesky, L D L^T.
class EigenCholeskySolver : public LinearSolver {
 public:
  double PredictBytes(const CsrMatrix<double>& matrix) override {
    ldlt_.analyzePattern(TransposedEigen(matrix));
    constexpr int kBytesPerEntry = sizeof(double) + sizeof(std::int64_t);
    // The factor, the matrix in Eigen's own form, and its permuted copies.
    return kBytesPerEntry * (static_cast<double>(ldlt_.factor_entries()) +
                             3 * static_cast<double>(matrix.entries()));
  }

  void Factorize(const CsrMatrix<double>& matrix) override {
    ldlt_.compute(TransposedEigen(matrix));
    rcond_ = 0;
    if (ldlt_.info() != Eigen::Success) return;  // a pivot of 0
    const Eigen::VectorXd pivots = ldlt_.vectorD();
    if (pivots.minCoeff() > 0) rcond_ = pivots.minCoeff() / pivots.maxCoeff();
  }

  std::optional<double> rcond() const override { return rcond_; }
  std::vector<double> Solve(const std::vector<double>& b) override {
    return ToVector(ldlt_.solve(MapOf(b)));
  }

 private:
  struct Ldlt : Eigen::SimplicialLDLT<EigenMatrix> {
    Eigen::Index factor_entries() const { return m_matrix.nonZeros(); }
  };
  Ldlt ldlt_;
  double rcond_ = 0;
};

// LU of the transpose; both directions of solution are at hand.
class EigenLuSolver : public LinearSolver {
 public:
  double PredictBytes(const CsrMatrix<double>& matrix) override {
    // SparseLU reports no fill before it factorises. Its ordering is for A^T A, whose Cholesky
    // factor bounds the factors of A; here the factor of A^T + A, counted twice for L and U,
    // predicts the fill.
    EigenMatrix pattern = TransposedEigen(matrix);
    EigenMatrix symmetric = EigenMatrix(pattern.transpose()) + pattern;
    for (double& value : Eigen::Map<Eigen::ArrayXd>(symmetric.valuePtr(), symmetric.nonZeros())) {
      value = 1;
    }
    CsrMatrix<double> sum;
    sum.rows = sum.columns = matrix.rows;
    sum.row_start.assign(symmetric.outerIndexPtr(), symmetric.outerIndexPtr() + matrix.rows + 1);
    sum.column.assign(symmetric.innerIndexPtr(), symmetric.innerIndexPtr() + symmetric.nonZeros());
    sum.value.assign(symmetric.valuePtr(), symmetric.valuePtr() + symmetric.nonZeros());
    return 4 * EigenCholeskySolver().PredictBytes(sum);
  }

  void Factorize(const CsrMatrix<double>& matrix) override {
    const EigenMatrix transposed = TransposedEigen(matrix);
    lu_.compute(transposed);
    rcond_ = 0;
    if (lu_.info() != Eigen::Success) return;
    double norm = 0;  // |A^T|_1
    for (Eigen::Index j = 0; j < transposed.cols(); ++j) {
      norm = std::max(norm, transposed.col(j).cwiseAbs().sum());
    }
    rcond_ = 1 / (norm * InverseNorm(transposed.rows()));
  }

  std::optional<double> rcond() const override { return rcond_; }
  std::vector<double> Solve(const std::vector<double>& b) override {
    return ToVector(lu_.transpose().solve(MapOf(b)));
  }

 private:
  // Hager's estimate of |A^-T|_1, a lower bound that is seldom off by more than 3 (Higham, Accuracy
  // and Stability of Numerical Algorithms, algorithm 15.1).
  double InverseNorm(Eigen::Index n) {
    Eigen::VectorXd x = Eigen::VectorXd::Constant(n, 1.0 / static_cast<double>(n));
    double norm = 0;
    constexpr int kMaxSteps = 5;
    for (int step = 0; step < kMaxSteps; ++step) {
      const Eigen::VectorXd y = lu_.solve(x);
      if (!(y.lpNorm<1>() > norm)) break;
      norm = y.lpNorm<1>();
      const Eigen::VectorXd signs = y.unaryExpr([](double v) { return v >= 0 ? 1.0 : -1.0; });
      const Eigen::VectorXd z = lu_.transpose().solve(signs);
      Eigen::Index largest = 0;
      if (!(z.cwiseAbs().maxCoeff(&largest) > z.dot(x))) break;
      x = Eigen::VectorXd::Unit(n, largest);
    }
    return norm;
  }

  Eigen::SparseLU<EigenMatrix, Eigen::COLAMDOrdering<std::int64_t>> lu_;
  double rcond_ = 0;
};

}  // namespace

std::unique_ptr<LinearSolver> NewEigenSolver(bool symmetric) {
  if (symmetric) return std::make_unique<EigenCholeskySolver>();
  return std::make_unique<EigenLuSolver>();
}

}  // namespace thicklens::estimator
