#ifndef THICKLENS_CALIB_FIT_WHITENED_COVARIANCE_H_
#define THICKLENS_CALIB_FIT_WHITENED_COVARIANCE_H_

#include <Eigen/Core>

namespace thicklens::calib {

// The covariance C of an estimator's samples, inverted once for all fits to them: B = L^-1 with
// L L^T = C, so that B r has unit covariance, and A = B^T B = C^-1.
//   Fits reweight their samples in every round: C_ij becomes C_ij/sqrt(w_i w_j). Its B and A result
//   from those of C if the samples are scaled by sqrt(w).
//   The reference of a relative measurement has no error and would make C singular: a small term,
//   the regularisation, on the diagonal keeps C regular.
class WhitenedCovariance {
 public:
  explicit WhitenedCovariance(const Eigen::MatrixXd& covariance);

  // Returns the factors by which the samples' residuals are multiplied for these weights, before B.
  // The reference, which has nothing but its regularisation, keeps the regularisation of the
  // weighted covariance.
  Eigen::VectorXd Factors(const Eigen::VectorXd& weights) const;

  // B y and B^T y for columns.
  Eigen::MatrixXd Whitened(const Eigen::MatrixXd& y) const;
  Eigen::MatrixXd TransposeWhitened(const Eigen::MatrixXd& y) const;
  const Eigen::MatrixXd& matrix() const { return information_; }  // A

 private:
  Eigen::VectorXd variances_;  // variances of the samples, without the regularisation
  double regularisation_ = 0;
  Eigen::MatrixXd inverse_root_, information_;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_FIT_WHITENED_COVARIANCE_H_
