#ifndef THICKLENS_CALIB_FIT_METER_INFORMATION_H_
#define THICKLENS_CALIB_FIT_METER_INFORMATION_H_

#include <Eigen/Core>

namespace thicklens::calib {

// The covariance C of a meter's samples, inverted once for all fits to them: B = L^-1 with
// L L^T = C, so that B r has unit covariance, and A = B^T B = C^-1.
//   Fits weigh their samples anew in every round: C_ij becomes C_ij/sqrt(w_i w_j), of which B and A
// follow by scaling the samples themselves by sqrt(w).
//   A relative measurement's own reference has no error and would make C singular: a hair on the
// diagonal keeps it whole.
class MeterInformation {
 public:
  explicit MeterInformation(const Eigen::MatrixXd& covariance);

  // What to multiply the samples' residuals by for these weights, before B. The reference, which
  // has nothing but its hair, keeps the hair that belongs to the weighted covariance.
  Eigen::VectorXd Factors(const Eigen::VectorXd& weights) const;

  // B y and B^T y, of columns.
  Eigen::MatrixXd Whitened(const Eigen::MatrixXd& y) const;
  Eigen::MatrixXd TransposeWhitened(const Eigen::MatrixXd& y) const;
  const Eigen::MatrixXd& matrix() const { return information_; }  // A

 private:
  Eigen::VectorXd variances_;  // of the samples, without the hair
  double hair_ = 0;
  Eigen::MatrixXd inverse_root_, information_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_METER_INFORMATION_H_
