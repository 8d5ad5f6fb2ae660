#ifndef THICKLENS_ESTIMATOR_BLOCKS_LINEAR_SOLVER_KINDS_H_
#define THICKLENS_ESTIMATOR_BLOCKS_LINEAR_SOLVER_KINDS_H_

#include <memory>

#include "estimator/blocks/linear_solver.h"

namespace thicklens::estimator {

// Solvers that NewLinearSolver chooses from. The solvers of SuiteSparse and ViennaCL exist only in
// builds that include these libraries.
std::unique_ptr<LinearSolver> NewUmfpackSolver();
std::unique_ptr<LinearSolver> NewCholmodSolver();
// Simplicial Cholesky, or LU for a matrix that is not symmetric.
std::unique_ptr<LinearSolver> NewEigenSolver(bool symmetric);
// Conjugate gradients (for a symmetric matrix) and BiCGSTAB of Eigen, with a diagonal
// preconditioner.
std::unique_ptr<LinearSolver> NewEigenCgSolver(const LinearSolverLimits& limits);
std::unique_ptr<LinearSolver> NewEigenBicgstabSolver(const LinearSolverLimits& limits);
// BiCGStab of ViennaCL, without a preconditioner, on the OpenCL device that ViennaCL chooses.
std::unique_ptr<LinearSolver> NewViennaClSolver(const LinearSolverLimits& limits);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLOCKS_LINEAR_SOLVER_KINDS_H_
