#ifndef THICKLENS_CALIB_FIT_BLUR_COVARIANCE_H_
#define THICKLENS_CALIB_FIT_BLUR_COVARIANCE_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/fit/blur_fit.h"

namespace thicklens::calib {

// The weighted residuals at a fit's end with their derivatives, the readings' errors eliminated.
struct BlurJacobian {
  std::vector<BlurParameter> free;  // what the first columns stand for; nuisances follow
  Eigen::MatrixXd values;
  Eigen::VectorXd residuals;
  Eigen::Index eliminated = 0;  // parameters that were
  double lost_weight = 0;       // of the residuals: what loses all its weight is no datum
};

// Fills in the covariance by SVD, chi^2, the factor by which the errors are widened and the
// direction that is known worst. Returns the covariance of all columns, not widened; nothing where
// the data do not tell the parameters apart, or are too few: then the message says so.
std::optional<Eigen::MatrixXd> FillCovariance(const BlurJacobian& jacobian,
                                              bool reading_sigma_is_known, BlurFitResult* result);

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_BLUR_COVARIANCE_H_
