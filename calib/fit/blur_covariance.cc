#include "calib/fit/blur_covariance.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

namespace thicklens::calib {
namespace {

constexpr std::array<const char*, kBlurParameters> kNames = {"focus_depth_mm", "blur_ratio",
                                                             "blur_floor_px", "bench_offset_mm"};
// Singular values below this part of the largest: the data do not determine that combination.
constexpr double kMinSingular = 1e-7;

// Returns the chi^2 per degree of freedom that chance exceeds once in a hundred (Wilson and
// Hilferty 1931) [L9].
double LargestByChance(double freedom) {
  const double spread = 2 / (9 * freedom);
  return std::pow(1 - spread + 2.326 * std::sqrt(spread), 3);
}

void NameWeak(const std::vector<BlurParameter>& free, const Eigen::VectorXd& direction,
              std::string* weak) {
  for (std::size_t i = 0; i < free.size(); ++i) {
    if (std::abs(direction[static_cast<Eigen::Index>(i)]) < 0.2) continue;
    *weak += (weak->empty() ? "" : " with ") + std::string(kNames[free[i]]);
  }
  if (weak->empty()) *weak = "the nuisance of the target";
}

// Names the longest axis of the correlation matrix: the least certain combination, independent of
// units.
void NameWorst(const std::vector<BlurParameter>& free, BlurFitResult* result) {
  const Eigen::Matrix4d& covariance = result->covariance;
  const auto correlation = [&](std::size_t a, std::size_t b) {
    return covariance(free[a], free[b]) /
           std::sqrt(covariance(free[a], free[a]) * covariance(free[b], free[b]));
  };
  std::size_t a = 0, b = 1;
  for (std::size_t i = 0; i < free.size(); ++i) {
    for (std::size_t j = i + 1; j < free.size(); ++j) {
      if (std::abs(correlation(i, j)) > std::abs(correlation(a, b))) {
        a = i;
        b = j;
      }
    }
  }
  result->weak_correlation = correlation(a, b);
  result->weak_direction = fmt::format("{} with {} (correlation {:+.2f})", kNames[free[a]],
                                       kNames[free[b]], result->weak_correlation);
}

}  // namespace

std::optional<Eigen::MatrixXd> FillCovariance(const BlurJacobian& jacobian,
                                              bool reading_sigma_is_known, BlurFitResult* result) {
  const double freedom = static_cast<double>(jacobian.values.rows()) -
                         static_cast<double>(jacobian.values.cols() + jacobian.eliminated) -
                         jacobian.lost_weight;
  if (!(freedom > 0.5)) {
    result->message = "too few frames follow the blur law to estimate its errors";
    return std::nullopt;
  }
  result->chi2_per_dof = jacobian.residuals.squaredNorm() / freedom;

  // In units of the parameters' own size, singular values show what the data leave free.
  const Eigen::VectorXd norms = jacobian.values.colwise().norm().cwiseMax(1e-300);
  const Eigen::MatrixXd scaled = jacobian.values * norms.cwiseInverse().asDiagonal();
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(scaled, Eigen::ComputeThinV);
  const Eigen::VectorXd& singular = svd.singularValues();
  if (!(singular.tail<1>()[0] > kMinSingular * singular[0])) {
    NameWeak(jacobian.free, svd.matrixV().rightCols<1>(), &result->weak_direction);
    result->message = "the data do not distinguish: " + result->weak_direction;
    return std::nullopt;
  }
  const Eigen::MatrixXd half =
      norms.cwiseInverse().asDiagonal() * svd.matrixV() * singular.cwiseInverse().asDiagonal();
  const bool widen = !reading_sigma_is_known || result->chi2_per_dof > LargestByChance(freedom);
  result->error_factor = widen ? std::sqrt(std::max(result->chi2_per_dof, 1e-4)) : 1;
  const double factor = result->error_factor * result->error_factor;

  const Eigen::MatrixXd covariance = half * half.transpose();
  for (std::size_t a = 0; a < jacobian.free.size(); ++a) {
    for (std::size_t b = 0; b < jacobian.free.size(); ++b) {
      result->covariance(jacobian.free[a], jacobian.free[b]) =
          factor * covariance(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
    }
  }
  NameWorst(jacobian.free, result);
  return covariance;
}

}  // namespace thicklens::calib
