#ifndef THICKLENS_CALIB_FIT_BLUR_COVARIANCE_H_
#define THICKLENS_CALIB_FIT_BLUR_COVARIANCE_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/fit/blur_fit.h"

namespace thicklens::calib {

// The weighted residuals at the end of a fit with their derivatives; the readings' errors are
// eliminated.
struct BlurJacobian {
  std::vector<BlurParameter> free;  // parameters of the first columns; nuisances follow
  Eigen::MatrixXd values;
  Eigen::VectorXd residuals;
  Eigen::Index eliminated = 0;  // number of parameters that were eliminated
  double lost_weight = 0;       // sum of 1 - weight: a residual of weight 0 is no datum
};

// Fills in the covariance by SVD, chi^2, the factor by which the errors are widened and the
// direction that is least certain. Returns the covariance of all columns, not widened. Returns
// nothing where the data do not separate the parameters, or are too few; the message then says so.
std::optional<Eigen::MatrixXd> FillCovariance(const BlurJacobian& jacobian,
                                              bool reading_sigma_is_known, BlurFitResult* result);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_COVARIANCE_H_
