#include "calib/fit/variable_projection.h"

#include <Eigen/Dense>
#include <algorithm>
#include <optional>

#include "thicklens/base/cancel.h"

namespace thicklens::calib {
namespace {

constexpr int kMaxSteps = 50;
constexpr int kMaxHalvings = 40;
// The cost is at its minimum when a step would lower it by less than this part of it.
constexpr double kEnough = 1e-16;
// Changes below this part of the cost are lost in its rounding: no comparison is possible.
constexpr double kRounding = 1e-11;
// Maximum part of a reading's own information that a curvature may remove: Newton's matrix remains
// positive definite.
constexpr double kMaxLost = 0.9;

// Returns Newton's matrix: the second derivatives of half the cost.
Eigen::MatrixXd NewtonMatrix(const BlurResiduals& residuals, const BlurResiduals::Terms& terms,
                             const Eigen::VectorXd& values) {
  Eigen::MatrixXd matrix = residuals.ErrorNormal(terms);
  const Eigen::VectorXd curvature = residuals.ErrorCurvature(terms, values);
  const Eigen::VectorXd own = residuals.OwnInformation(terms);
  matrix.diagonal() += curvature.cwiseMax(-kMaxLost * own);
  return matrix;
}

}  // namespace

bool SolveErrors(const BlurResiduals& residuals, BlurParameters* parameters) {
  std::optional<BlurResiduals::Terms> terms = residuals.At(*parameters);
  if (!terms) return false;
  if (residuals.readings_are_exact()) return true;
  Eigen::VectorXd values = residuals.Values(*terms);
  for (int step = 0; step < kMaxSteps; ++step) {
    ThrowIfCancelled();
    const Eigen::VectorXd gradient = residuals.TransposeTimesErrors(*terms, values);
    const Eigen::LLT<Eigen::MatrixXd> newton(NewtonMatrix(residuals, *terms, values));
    if (newton.info() != Eigen::Success) return false;
    const Eigen::VectorXd direction = -newton.solve(gradient);
    const double promised = -gradient.dot(direction), cost = values.squaredNorm();
    if (!(promised > kEnough * (1 + cost))) return true;
    bool moved = false;
    double part = 1;
    for (int halving = 0; halving < kMaxHalvings && !moved; ++halving, part /= 2) {
      BlurParameters next = *parameters;
      next.errors_mm += part * direction;
      std::optional<BlurResiduals::Terms> there = residuals.At(next);
      if (!there) continue;
      Eigen::VectorXd values_there = residuals.Values(*there);
      if (!(values_there.squaredNorm() < cost - 1e-4 * part * promised) &&
          !(promised < kRounding * cost))
        continue;
      *parameters = std::move(next);
      terms = std::move(there);
      values = std::move(values_there);
      moved = true;
    }
    if (!moved) return true;
  }
  return true;
}

ReducedProblem Reduce(const BlurResiduals& residuals, const BlurParameters& parameters) {
  const std::optional<BlurResiduals::Terms> terms = residuals.At(parameters);
  ReducedProblem reduced;
  reduced.values = residuals.Values(*terms);
  reduced.jacobian = residuals.Jacobian(parameters);
  if (residuals.readings_are_exact()) return reduced;
  const Eigen::LLT<Eigen::MatrixXd> normal(residuals.ErrorNormal(*terms));
  reduced.error_response =
      Eigen::MatrixXd::Zero(parameters.errors_mm.size(), reduced.jacobian.cols());
  // The projection runs twice: the second pass removes the part of the errors' span that rounding
  // leaves after the first.
  for (int pass = 0; pass < 2; ++pass) {
    const Eigen::MatrixXd response =
        -normal.solve(residuals.TransposeTimesErrors(*terms, reduced.jacobian));
    reduced.jacobian += residuals.TimesErrors(*terms, response);
    reduced.error_response += response;
  }
  return reduced;
}

Eigen::VectorXd ErrorVariances(const BlurResiduals& residuals, const BlurParameters& parameters,
                               const Eigen::MatrixXd& error_response,
                               const Eigen::MatrixXd& covariance) {
  const Eigen::Index n = parameters.errors_mm.size();
  if (residuals.readings_are_exact()) return Eigen::VectorXd::Zero(n);
  const Eigen::LLT<Eigen::MatrixXd> normal(residuals.ErrorNormal(*residuals.At(parameters)));
  Eigen::MatrixXd inverse_root = Eigen::MatrixXd::Identity(n, n);
  normal.matrixL().solveInPlace(inverse_root);
  return inverse_root.colwise().squaredNorm().transpose() +
         (error_response * covariance).cwiseProduct(error_response).rowwise().sum();
}

}  // namespace thicklens::calib
