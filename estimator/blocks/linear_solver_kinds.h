#ifndef THICKLENS_ESTIMATOR_BLOCKS_LINEAR_SOLVER_KINDS_H_
#define THICKLENS_ESTIMATOR_BLOCKS_LINEAR_SOLVER_KINDS_H_

#include <memory>

#include "estimator/blocks/linear_solver.h"

namespace thicklens::estimator {

// What NewLinearSolver chooses from. Those of SuiteSparse and ViennaCL are there only in builds
// that have these.
std::unique_ptr<LinearSolver> NewUmfpackSolver();
std::unique_ptr<LinearSolver> NewCholmodSolver();
// Simplicial Cholesky; LU of a matrix that is not symmetric.
std::unique_ptr<LinearSolver> NewEigenSolver(bool symmetric);
// Conjugate gradients (of a symmetric matrix) and BiCGSTAB of Eigen, preconditioned by the
// diagonal.
std::unique_ptr<LinearSolver> NewEigenCgSolver(const IterationLimits& limits);
std::unique_ptr<LinearSolver> NewEigenBicgstabSolver(const IterationLimits& limits);
// BiCGStab of ViennaCL on the OpenCL device it chooses, without a preconditioner.
std::unique_ptr<LinearSolver> NewViennaClSolver(const IterationLimits& limits);

}  // namespace thicklens::estimator

#endif  // THICKLENS_ESTIMATOR_BLOCKS_LINEAR_SOLVER_KINDS_H_
