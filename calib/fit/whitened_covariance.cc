#include "calib/fit/whitened_covariance.h"

#include <Eigen/Dense>
#include <cmath>

namespace thicklens::calib {
namespace {

double Regularisation(const Eigen::VectorXd& variances) {
  return variances.size() > 0 ? 1e-9 * variances.maxCoeff() + 1e-12 : 1e-12;
}

}  // namespace

WhitenedCovariance::WhitenedCovariance(const Eigen::MatrixXd& covariance)
    : variances_(covariance.diagonal()), regularisation_(Regularisation(variances_)) {
  const Eigen::Index n = covariance.rows();
  Eigen::MatrixXd whole = covariance;
  whole.diagonal().array() += regularisation_;
  inverse_root_ = Eigen::MatrixXd::Identity(n, n);
  whole.llt().matrixL().solveInPlace(inverse_root_);
  Eigen::MatrixXd lower = Eigen::MatrixXd::Zero(n, n);
  lower.selfadjointView<Eigen::Lower>().rankUpdate(inverse_root_.transpose());
  information_ = lower.selfadjointView<Eigen::Lower>();
}

Eigen::VectorXd WhitenedCovariance::Factors(const Eigen::VectorXd& weights) const {
  Eigen::VectorXd factors = weights.cwiseSqrt();
  const double weighted_regularisation = Regularisation(variances_.cwiseQuotient(weights));
  for (Eigen::Index i = 0; i < factors.size(); ++i) {
    if (!(variances_[i] > 0)) factors[i] = std::sqrt(regularisation_ / weighted_regularisation);
  }
  return factors;
}

Eigen::MatrixXd WhitenedCovariance::Whitened(const Eigen::MatrixXd& y) const {
  return inverse_root_.triangularView<Eigen::Lower>() * y;
}

Eigen::MatrixXd WhitenedCovariance::TransposeWhitened(const Eigen::MatrixXd& y) const {
  return inverse_root_.transpose().triangularView<Eigen::Upper>() * y;
}

}  // namespace thicklens::calib
