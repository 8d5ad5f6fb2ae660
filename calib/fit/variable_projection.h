#ifndef THICKLENS_CALIB_FIT_VARIABLE_PROJECTION_H_
#define THICKLENS_CALIB_FIT_VARIABLE_PROJECTION_H_

#include <Eigen/Core>

#include "calib/fit/blur_residuals.h"

namespace thicklens::calib {

// A fit of the blur has one unknown for every reading, its error e, besides the few parameters p
// that are sought. Here the errors are eliminated (variable projection, Golub and Pereyra 1973):
// for given p the best errors e(p) are found. The remaining residuals r(p, e(p)) depend on p alone.

// Finds e(p) by Newton's method from the errors in `parameters`, with steps halved until the cost
// falls. Returns false where no errors can be found: a depth is not positive.
bool SolveErrors(const BlurResiduals& residuals, BlurParameters* parameters);

// The residuals at `parameters` and their Jacobian by p, which is J_p minus its part in the span of
// the errors' Jacobian J_e (derived here, [D75]):
//   J = J_p + J_e D, D = -(J_e^T J_e)^-1 J_e^T J_p.
// Therefore (J^T J)^-1 is the block of p in the inverse of the whole problem's matrix (Schur
// complement), and, because J_e^T r = 0 at e(p), J^T r is the gradient of the cost.
struct ReducedProblem {
  Eigen::VectorXd values;
  Eigen::MatrixXd jacobian;
  Eigen::MatrixXd error_response;  // D: change of the best errors with p, to first order
};
ReducedProblem Reduce(const BlurResiduals& residuals, const BlurParameters& parameters);

// Returns the variances of the errors: diag (J_e^T J_e)^-1 + D C D^T, where C is the covariance of
// p.
Eigen::VectorXd ErrorVariances(const BlurResiduals& residuals, const BlurParameters& parameters,
                               const Eigen::MatrixXd& error_response,
                               const Eigen::MatrixXd& covariance);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_VARIABLE_PROJECTION_H_
