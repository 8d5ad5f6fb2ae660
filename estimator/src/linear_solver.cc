#include "linear_solver.h"

#include <fmt/format.h>

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <Eigen/SparseLU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>

#ifdef THICKLENS_WITH_GPL
#include <cholmod.h>
#include <umfpack.h>
#endif

#include "thicklens/error.h"

namespace thicklens::estimator {
namespace {

using kernels::CsrMatrix;

std::size_t Size(int n) { return static_cast<std::size_t>(n); }

#ifdef THICKLENS_WITH_GPL

using Long = SuiteSparse_long;
static_assert(sizeof(Long) == sizeof(std::int64_t), "the 64-bit interfaces are meant");

// UMFPACK reads compressed columns: our rows are the columns of the transpose, which it solves
// with as UMFPACK_At.
class UmfpackSolver : public LinearSolver {
 public:
  UmfpackSolver() {
    umfpack_dl_defaults(control_);
    // The nested dissection of METIS costs as much as the factor at the size of a block.
    control_[UMFPACK_ORDERING] = UMFPACK_ORDERING_AMD;
    control_[UMFPACK_PRL] = 0;  // no printing
  }
  ~UmfpackSolver() override { Free(); }
  UmfpackSolver(const UmfpackSolver&) = delete;
  UmfpackSolver& operator=(const UmfpackSolver&) = delete;

  double PredictBytes(const CsrMatrix<double>& matrix) override {
    Analyse(matrix);
    return info_[UMFPACK_PEAK_MEMORY_ESTIMATE] * info_[UMFPACK_SIZE_OF_UNIT];
  }

  void Factorize(const CsrMatrix<double>& matrix) override {
    Analyse(matrix);
    const Long status = umfpack_dl_numeric(start_.data(), index_.data(), value_.data(), symbolic_,
                                           &numeric_, control_, info_);
    if (status == UMFPACK_WARNING_singular_matrix) {
      rcond_ = 0;
      return;
    }
    Check(status, "factorisation");
    rcond_ = info_[UMFPACK_RCOND];
  }

  double rcond() const override { return rcond_; }

  std::vector<double> Solve(const std::vector<double>& b) override {
    std::vector<double> x(b.size());
    Check(umfpack_dl_solve(UMFPACK_At, start_.data(), index_.data(), value_.data(), x.data(),
                           b.data(), numeric_, control_, info_),
          "solution");
    return x;
  }

 private:
  void Analyse(const CsrMatrix<double>& matrix) {
    Free();
    start_.assign(matrix.row_start.begin(), matrix.row_start.end());
    index_.assign(matrix.column.begin(), matrix.column.end());
    value_ = matrix.value;
    Check(umfpack_dl_symbolic(matrix.rows, matrix.rows, start_.data(), index_.data(), value_.data(),
                              &symbolic_, control_, info_),
          "analysis");
  }

  static void Check(Long status, const char* step) {
    if (status == UMFPACK_OK) return;
    if (status == UMFPACK_ERROR_out_of_memory) {
      throw Error(fmt::format("UMFPACK: out of memory in the {}; smaller blocks need less", step));
    }
    throw Error(fmt::format("UMFPACK: the {} failed with status {}", step, status));
  }

  void Free() {
    if (symbolic_ != nullptr) umfpack_dl_free_symbolic(&symbolic_);
    if (numeric_ != nullptr) umfpack_dl_free_numeric(&numeric_);
  }

  double control_[UMFPACK_CONTROL];
  double info_[UMFPACK_INFO];
  std::vector<Long> start_, index_;
  std::vector<double> value_;
  void* symbolic_ = nullptr;
  void* numeric_ = nullptr;
  double rcond_ = 0;
};

class CholmodSolver : public LinearSolver {
 public:
  CholmodSolver() {
    cholmod_l_start(&common_);
    common_.print = 0;
    common_.nmethods = 1;
    common_.method[0].ordering = CHOLMOD_AMD;
    // L L^T also where there are no supernodes: L D L^T would take negative pivots without a word.
    common_.final_ll = 1;
    common_.quick_return_if_not_posdef = 1;
  }
  ~CholmodSolver() override {
    cholmod_l_free_factor(&factor_, &common_);
    cholmod_l_finish(&common_);
  }
  CholmodSolver(const CholmodSolver&) = delete;
  CholmodSolver& operator=(const CholmodSolver&) = delete;

  double PredictBytes(const CsrMatrix<double>& matrix) override {
    Analyse(matrix);
    // Supernodes store zeros too, and one frontal matrix at a time is assembled beside them.
    const double stored = factor_->is_super != 0 ? static_cast<double>(factor_->xsize) +
                                                       static_cast<double>(factor_->maxcsize)
                                                 : 2 * common_.lnz;
    // A permuted copy of a triangle of the matrix is made on the way.
    constexpr double kPerEntry = sizeof(double) + sizeof(Long);
    return stored * sizeof(double) + kPerEntry * static_cast<double>(matrix.entries());
  }

  void Factorize(const CsrMatrix<double>& matrix) override {
    Analyse(matrix);
    cholmod_sparse view = View();
    cholmod_l_factorize(&view, factor_, &common_);
    if (common_.status == CHOLMOD_NOT_POSDEF) {
      rcond_ = 0;
      return;
    }
    Check("factorisation");
    rcond_ = cholmod_l_rcond(factor_, &common_);
  }

  double rcond() const override { return rcond_; }

  std::vector<double> Solve(const std::vector<double>& b) override {
    cholmod_dense right{};
    right.nrow = right.d = right.nzmax = b.size();
    right.ncol = 1;
    right.x = const_cast<double*>(b.data());  // NOLINT: only read
    right.xtype = CHOLMOD_REAL;
    right.dtype = CHOLMOD_DOUBLE;
    cholmod_dense* solution = cholmod_l_solve(CHOLMOD_A, factor_, &right, &common_);
    if (solution == nullptr) Check("solution");
    const auto* values = static_cast<const double*>(solution->x);
    std::vector<double> x(values, values + b.size());
    cholmod_l_free_dense(&solution, &common_);
    return x;
  }

 private:
  void Analyse(const CsrMatrix<double>& matrix) {
    cholmod_l_free_factor(&factor_, &common_);
    rows_ = Size(matrix.rows);
    start_.assign(matrix.row_start.begin(), matrix.row_start.end());
    index_.assign(matrix.column.begin(), matrix.column.end());
    value_ = matrix.value;
    cholmod_sparse view = View();
    factor_ = cholmod_l_analyze(&view, &common_);
    Check("analysis");
  }

  // Rows of a symmetric matrix are its columns.
  cholmod_sparse View() {
    cholmod_sparse view{};
    view.nrow = view.ncol = rows_;
    view.nzmax = value_.size();
    view.p = start_.data();
    view.i = index_.data();
    view.x = value_.data();
    view.stype = -1;  // symmetric; the lower triangle is read
    view.itype = CHOLMOD_LONG;
    view.xtype = CHOLMOD_REAL;
    view.dtype = CHOLMOD_DOUBLE;
    view.sorted = 1;
    view.packed = 1;
    return view;
  }

  void Check(const char* step) const {
    if (common_.status >= CHOLMOD_OK) return;
    if (common_.status == CHOLMOD_OUT_OF_MEMORY) {
      throw Error(fmt::format("CHOLMOD: out of memory in the {}; smaller blocks need less", step));
    }
    throw Error(fmt::format("CHOLMOD: the {} failed with status {}", step, common_.status));
  }

  cholmod_common common_;
  cholmod_factor* factor_ = nullptr;
  std::size_t rows_ = 0;
  std::vector<Long> start_, index_;
  std::vector<double> value_;
  double rcond_ = 0;
};

#endif  // THICKLENS_WITH_GPL

using EigenMatrix = Eigen::SparseMatrix<double, Eigen::ColMajor, std::int64_t>;

// Rows become columns: the transpose.
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

  double rcond() const override { return rcond_; }
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
    // SparseLU tells no fill before it is made. Its ordering is for A^T A, whose Cholesky factor
    // bounds those of A; that of A^T + A, twice for L and U, is what it comes to here.
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

  double rcond() const override { return rcond_; }
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

BlockSolver BlockSolverFromName(const std::string& name) {
  if (name == "umfpack") return BlockSolver::kUmfpack;
  if (name == "cholmod") return BlockSolver::kCholmod;
  if (name == "eigen") return BlockSolver::kEigen;
  throw Error(
      fmt::format("block solver \"{}\" is unknown: it must be umfpack, cholmod or eigen", name));
}

std::string BlockSolverName(BlockSolver solver) {
  switch (solver) {
    case BlockSolver::kUmfpack:
      return "umfpack";
    case BlockSolver::kCholmod:
      return "cholmod";
    case BlockSolver::kEigen:
      break;
  }
  return "eigen";
}

bool IsBuiltIn(BlockSolver solver) {
#ifdef THICKLENS_WITH_GPL
  static_cast<void>(solver);
  return true;
#else
  return solver == BlockSolver::kEigen;
#endif
}

BlockSolver DefaultBlockSolver() {
  return IsBuiltIn(BlockSolver::kUmfpack) ? BlockSolver::kUmfpack : BlockSolver::kEigen;
}

std::unique_ptr<LinearSolver> NewLinearSolver(BlockSolver solver, bool symmetric) {
  if (!IsBuiltIn(solver)) {
    throw Error(
        fmt::format("block solver \"{}\": this program was built without the GPL parts of "
                    "SuiteSparse (THICKLENS_WITH_GPL=OFF); eigen is there",
                    BlockSolverName(solver)));
  }
  if (solver == BlockSolver::kEigen) {
    if (symmetric) return std::make_unique<EigenCholeskySolver>();
    return std::make_unique<EigenLuSolver>();
  }
#ifdef THICKLENS_WITH_GPL
  if (solver == BlockSolver::kUmfpack) return std::make_unique<UmfpackSolver>();
  if (!symmetric) {
    throw Error(
        "block solver \"cholmod\": the source's stencil makes a system that is not symmetric, "
        "which a Cholesky factor cannot solve; umfpack or eigen can");
  }
  return std::make_unique<CholmodSolver>();
#else
  return nullptr;  // not reached
#endif
}

double RelativeResidual(const CsrMatrix<double>& a, const std::vector<double>& x,
                        const std::vector<double>& b) {
  double residual = 0;
  double right = 0;
  for (int row = 0; row < a.rows; ++row) {
    double sum = b[Size(row)];
    right += sum * sum;
    for (std::int64_t e = a.row_start[Size(row)]; e < a.row_start[Size(row) + 1]; ++e) {
      const auto entry = static_cast<std::size_t>(e);
      sum -= a.value[entry] * x[Size(a.column[entry])];
    }
    residual += sum * sum;
  }
  return right > 0 ? std::sqrt(residual / right) : std::sqrt(residual);
}

}  // namespace thicklens::estimator
