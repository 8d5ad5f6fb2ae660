#include "estimator/blocks/iterative_solver.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace thicklens::estimator {
namespace {

// Returns b - A x.
std::vector<double> ResidualOf(const kernels::CsrMatrix<double>& a, const std::vector<double>& x,
                               const std::vector<double>& b) {
  std::vector<double> residual = b;
  for (std::size_t row = 0; row < residual.size(); ++row) {
    for (std::int64_t e = a.row_start[row]; e < a.row_start[row + 1]; ++e) {
      const auto entry = static_cast<std::size_t>(e);
      residual[row] -= a.value[entry] * x[static_cast<std::size_t>(a.column[entry])];
    }
  }
  return residual;
}

double Norm(const std::vector<double>& x) {
  double sum = 0;
  for (const double value : x) sum += value * value;
  return std::sqrt(sum);
}

}  // namespace

IterativeSolver::IterativeSolver(std::unique_ptr<IterativeMethod> method,
                                 const LinearSolverLimits& limits)
    : method_(std::move(method)), limits_(limits) {}

double IterativeSolver::PredictBytes(const kernels::CsrMatrix<double>& matrix) {
  constexpr double kPerEntry = sizeof(double) + sizeof(std::int32_t);  // the copy kept here
  // vectors of a method, and the residual, the solution and its update
  constexpr double kVectors = 12;
  return method_->BytesOf(matrix) + kPerEntry * static_cast<double>(matrix.entries()) +
         kVectors * sizeof(double) * matrix.rows;
}

void IterativeSolver::Factorize(const kernels::CsrMatrix<double>& matrix) {
  matrix_ = matrix;
  method_->SetMatrix(matrix_);
}

std::vector<double> IterativeSolver::Solve(const std::vector<double>& b) {
  return SolveFrom(std::vector<double>(b.size(), 0.0), b);
}

std::vector<double> IterativeSolver::SolveFrom(std::vector<double> start,
                                               const std::vector<double>& b) {
  iterations_ = 0;
  std::vector<double> x = std::move(start);
  std::vector<double> residual = ResidualOf(matrix_, x, b);
  double left = Norm(residual);
  const double goal = limits_.tolerance * Norm(b);
  // The true residual may be larger than the one that a method reports: the next pass aims at half
  // of the goal, and a pass after too little progress at a tenth of that.
  double share = 1;
  constexpr double kProgress = 0.9;
  constexpr int kMaxIdlePasses = 3;
  int idle_passes = 0;
  while (left > goal && iterations_ < limits_.max_iterations && idle_passes < kMaxIdlePasses) {
    const std::vector<double> update = method_->Run(
        residual, share * goal / left, limits_.max_iterations - iterations_, &iterations_);
    std::vector<double> next = x;
    for (std::size_t i = 0; i < x.size(); ++i) next[i] += update[i];
    std::vector<double> next_residual = ResidualOf(matrix_, next, b);
    const double next_left = Norm(next_residual);
    // This form treats values that are not finite as no progress.
    if (next_left < kProgress * left) {
      idle_passes = 0;
      share = std::min(share, 0.5);
    } else {
      ++idle_passes;
      share *= 0.1;
    }
    if (!(next_left < left)) continue;
    x = std::move(next);
    residual = std::move(next_residual);
    left = next_left;
  }
  return x;
}

}  // namespace thicklens::estimator
