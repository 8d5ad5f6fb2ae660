#include "estimator/blocks/linear_solver.h"

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "estimator/blocks/linear_solver_kinds.h"
#include "thicklens/base/error.h"

namespace thicklens::estimator {
namespace {

struct SolverName {
  BlockSolver solver;
  const char* name;
};
constexpr SolverName kNames[] = {
    {BlockSolver::kUmfpack, "umfpack"},   {BlockSolver::kCholmod, "cholmod"},
    {BlockSolver::kEigen, "eigen"},       {BlockSolver::kCg, "cg"},
    {BlockSolver::kBicgstab, "bicgstab"}, {BlockSolver::kViennaCl, "viennacl"},
};

[[noreturn]] void RefuseMissing(BlockSolver solver) {
  if (solver == BlockSolver::kViennaCl) {
    throw Error(
        "block solver \"viennacl\": this program was built without ViennaCL "
        "(THICKLENS_WITH_VIENNACL=OFF); use bicgstab, the same method on the processor");
  }
  throw Error(
      fmt::format("block solver \"{}\": this program was built without the GPL parts of "
                  "SuiteSparse (THICKLENS_WITH_GPL=OFF); use eigen",
                  BlockSolverName(solver)));
}

}  // namespace

BlockSolver BlockSolverFromName(const std::string& name) {
  std::string known;
  for (const SolverName& entry : kNames) {
    if (name == entry.name) return entry.solver;
    known += fmt::format("{}{}", known.empty() ? "" : ", ", entry.name);
  }
  throw Error(fmt::format("block solver \"{}\" is unknown: it must be one of {}", name, known));
}

std::string BlockSolverName(BlockSolver solver) {
  for (const SolverName& entry : kNames) {
    if (solver == entry.solver) return entry.name;
  }
  return "unknown";  // not reached
}

std::vector<BlockSolver> BuiltInBlockSolvers() {
  std::vector<BlockSolver> solvers;
  for (const SolverName& entry : kNames) {
    if (IsBuiltIn(entry.solver)) solvers.push_back(entry.solver);
  }
  return solvers;
}

bool IsBuiltIn(BlockSolver solver) {
  switch (solver) {
    case BlockSolver::kUmfpack:
    case BlockSolver::kCholmod:
#ifdef THICKLENS_WITH_GPL
      return true;
#else
      return false;
#endif
    case BlockSolver::kViennaCl:
#ifdef THICKLENS_WITH_VIENNACL
      return true;
#else
      return false;
#endif
    case BlockSolver::kEigen:
    case BlockSolver::kCg:
    case BlockSolver::kBicgstab:
      break;
  }
  return true;
}

bool IsIterative(BlockSolver solver) {
  return solver == BlockSolver::kCg || solver == BlockSolver::kBicgstab ||
         solver == BlockSolver::kViennaCl;
}

BlockSolver DefaultBlockSolver() {
  return IsBuiltIn(BlockSolver::kUmfpack) ? BlockSolver::kUmfpack : BlockSolver::kEigen;
}

std::unique_ptr<LinearSolver> NewLinearSolver(BlockSolver solver, bool symmetric,
                                              const LinearSolverLimits& limits) {
  if (!IsBuiltIn(solver)) RefuseMissing(solver);
  if (!symmetric && (solver == BlockSolver::kCholmod || solver == BlockSolver::kCg)) {
    throw Error(
        fmt::format("block solver \"{}\": the stencil of the paper makes a system that is not "
                    "symmetric, {}; use umfpack, eigen or bicgstab",
                    BlockSolverName(solver),
                    solver == BlockSolver::kCholmod ? "which a Cholesky factorisation cannot solve"
                                                    : "which conjugate gradients cannot solve"));
  }
  switch (solver) {
#ifdef THICKLENS_WITH_GPL
    case BlockSolver::kUmfpack:
      return NewUmfpackSolver();
    case BlockSolver::kCholmod:
      return NewCholmodSolver();
#endif
#ifdef THICKLENS_WITH_VIENNACL
    case BlockSolver::kViennaCl:
      return NewViennaClSolver(limits);
#endif
    case BlockSolver::kCg:
      return NewEigenCgSolver(limits);
    case BlockSolver::kBicgstab:
      return NewEigenBicgstabSolver(limits);
    default:
      return NewEigenSolver(symmetric);
  }
}

double RelativeResidual(const kernels::CsrMatrix<double>& a, const std::vector<double>& x,
                        const std::vector<double>& b) {
  double residual = 0;
  double right = 0;
  for (int row = 0; row < a.rows; ++row) {
    double sum = b[static_cast<std::size_t>(row)];
    right += sum * sum;
    const auto begin = static_cast<std::size_t>(a.row_start[static_cast<std::size_t>(row)]);
    const auto end = static_cast<std::size_t>(a.row_start[static_cast<std::size_t>(row) + 1]);
    for (std::size_t entry = begin; entry < end; ++entry) {
      sum -= a.value[entry] * x[static_cast<std::size_t>(a.column[entry])];
    }
    residual += sum * sum;
  }
  return right > 0 ? std::sqrt(residual / right) : std::sqrt(residual);
}

}  // namespace thicklens::estimator
