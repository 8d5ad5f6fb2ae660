#ifndef THICKLENS_CALIB_FIT_ERROR_ELIMINATION_H_
#define THICKLENS_CALIB_FIT_ERROR_ELIMINATION_H_

#include <Eigen/Core>

#include "calib/fit/blur_residuals.h"

namespace thicklens::calib {

// A fit of the blur has one unknown for every reading, its error e, beside the few that are asked
// for, p. Here the errors are eliminated (variable projection, Golub and Pereyra 1973): for given p
// the best errors e(p) are found, and the residuals r(p, e(p)) are left, which depend on p alone.

// e(p): Newton's method from the errors in `parameters`, with steps halved until the cost falls.
// False where no errors can be found: a depth is not positive.
bool SolveErrors(const BlurResiduals& residuals, BlurParameters* parameters);

// The residuals at `parameters` and their Jacobian by p, J_p less its part in the span of the
// errors' Jacobian J_e (derived here, [D75]):
//   J = J_p + J_e D, D = -(J_e^T J_e)^-1 J_e^T J_p,
// so that (J^T J)^-1 is the block of p in the inverse of the whole problem's (Schur complement),
// and, as J_e^T r = 0 at e(p), J^T r the gradient of the cost.
struct ReducedProblem {
  Eigen::VectorXd values;
  Eigen::MatrixXd jacobian;
  Eigen::MatrixXd error_response;  // D: how the best errors follow p, to first order
};
ReducedProblem Reduce(const BlurResiduals& residuals, const BlurParameters& parameters);

// Variances of the errors: diag (J_e^T J_e)^-1 + D C D^T, C the covariance of p.
Eigen::VectorXd ErrorVariances(const BlurResiduals& residuals, const BlurParameters& parameters,
                               const Eigen::MatrixXd& error_response,
                               const Eigen::MatrixXd& covariance);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_ERROR_ELIMINATION_H_
