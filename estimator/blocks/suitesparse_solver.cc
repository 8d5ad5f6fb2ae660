// UMFPACK and CHOLMOD are (in part) under the GPL; builds without GPL leave this file out.
#include <cholmod.h>
#include <fmt/format.h>
#include <umfpack.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "estimator/blocks/factor_memory.h"
#include "estimator/blocks/linear_solver_kinds.h"
#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

using kernels::CsrMatrix;
using Long = SuiteSparse_long;
static_assert(sizeof(Long) == sizeof(std::int64_t), "the 64-bit interfaces are meant");

// UMFPACK reads compressed columns: our rows are the columns of the transpose, and UMFPACK_At
// solves with the transpose.
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
    const FactorMemory::Use use(&memory_);
    const Long status = umfpack_dl_numeric(start_.data(), index_.data(), value_.data(), symbolic_,
                                           &numeric_, control_, info_);
    if (status == UMFPACK_WARNING_singular_matrix) {
      rcond_ = 0;
      return;
    }
    Check(status, "factorisation");
    rcond_ = info_[UMFPACK_RCOND];
  }

  std::optional<double> rcond() const override { return rcond_; }

  std::vector<double> Solve(const std::vector<double>& b) override {
    const FactorMemory::Use use(&memory_);
    std::vector<double> x(b.size());
    Check(umfpack_dl_solve(UMFPACK_At, start_.data(), index_.data(), value_.data(), x.data(),
                           b.data(), numeric_, control_, info_),
          "solution");
    return x;
  }

 private:
  void Analyse(const CsrMatrix<double>& matrix) {
    Free();
    const FactorMemory::Use use(&memory_);
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
    const FactorMemory::Use use(&memory_);
    if (symbolic_ != nullptr) umfpack_dl_free_symbolic(&symbolic_);
    if (numeric_ != nullptr) umfpack_dl_free_numeric(&numeric_);
  }

  FactorMemory memory_;
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
    // L L^T is used also without supernodes: L D L^T would accept negative pivots silently.
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
    // Supernodes also store zeros, and one frontal matrix at a time is assembled beside them.
    const double stored = factor_->is_super != 0 ? static_cast<double>(factor_->xsize) +
                                                       static_cast<double>(factor_->maxcsize)
                                                 : 2 * common_.lnz;
    // A permuted copy of a triangle of the matrix is made as well.
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

  std::optional<double> rcond() const override { return rcond_; }

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
    rows_ = static_cast<std::size_t>(matrix.rows);
    start_.assign(matrix.row_start.begin(), matrix.row_start.end());
    index_.assign(matrix.column.begin(), matrix.column.end());
    value_ = matrix.value;
    cholmod_sparse view = View();
    factor_ = cholmod_l_analyze(&view, &common_);
    Check("analysis");
  }

  // The rows of a symmetric matrix are its columns.
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

}  // namespace

std::unique_ptr<LinearSolver> NewUmfpackSolver() { return std::make_unique<UmfpackSolver>(); }

std::unique_ptr<LinearSolver> NewCholmodSolver() { return std::make_unique<CholmodSolver>(); }

}  // namespace thicklens::estimator
