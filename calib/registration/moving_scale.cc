#include "calib/registration/moving_scale.h"

#include <ceres/ceres.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "calib/registration/cancel_callback.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinSamples = 5;
constexpr double kCauchyWidth = 3;
constexpr double kScaleBias = 3e-5;  // common error of the registrations (image_scale.h)
constexpr double kKnown = 3;         // standard deviations
constexpr double kMinBeyond = 1e-6, kMaxBeyond = 1e4;  // of xf - f2, relative to f2
constexpr double kMinInformation = 1e-10;              // of a parameter alone

// ln(scale) of a frame against the law, in standard deviations. The parameters are ln(a) and
// ln(xf - f2), so that xf stays behind the focal point.
struct ScaleResidual {
  double reading_mm, log_scale, sigma;
  double f1_mm, f2_mm;
  double sign, focus_reading_mm;
  bool lens_moves;

  template <typename T>
  bool operator()(const T* log_a, const T* log_beyond, T* residual) const {
    using std::exp;
    using std::log;
    const T beyond_mm = exp(log_beyond[0]);
    const T xf_mm = beyond_mm + f2_mm;
    const T zf_mm = f1_mm * xf_mm / beyond_mm;
    const double moved_mm = sign * (reading_mm - focus_reading_mm);
    const T distance_mm = xf_mm + moved_mm;
    const T depth_mm = lens_moves ? T(zf_mm - moved_mm) : zf_mm;
    if (!(distance_mm > 0.0) || !(depth_mm > 0.0)) return false;
    residual[0] = (log(distance_mm / xf_mm) - log(depth_mm / zf_mm) + log_a[0] - log_scale) / sigma;
    return true;
  }
};

class MovingScaleFit {
 public:
  MovingScaleFit(const std::vector<ScaleSample>& samples, const model::ThickLens& lens,
                 model::SweepMotion moves, double sign, double focus_reading_mm,
                 double reading_sigma_mm)
      : lens_(lens) {
    for (const ScaleSample& s : samples) {
      if (s.scale_is_from_reading || !(s.scale > 0)) continue;
      rows_.push_back({s.reading_mm, std::log(s.scale),
                       std::hypot(s.registration.scale_sigma / s.scale, kScaleBias),
                       lens.front_focal_length_mm, lens.rear_focal_length_mm, sign,
                       focus_reading_mm, moves == model::SweepMotion::kLens});
    }
    reading_sigma_mm_ = std::max(0.0, reading_sigma_mm);
  }

  MovingScale Run() {
    MovingScale result;
    if (rows_.size() < kMinSamples) return result;
    result.slope_per_mm = Slope();
    for (ScaleResidual& row : rows_)
      row.sigma = std::hypot(row.sigma, result.slope_per_mm.value * reading_sigma_mm_);
    // The law has one minimum for each side of the start; the best of several starts is taken.
    double least = std::numeric_limits<double>::infinity();
    for (const double beyond : {0.01, 0.1, 0.5, 2.0, 10.0}) {
      double log_a = 0, log_beyond = std::log(beyond * lens_.rear_focal_length_mm), cost = 0;
      std::optional<double> sigma;
      if (!Solve(&log_a, &log_beyond, &cost, &sigma) || !(cost < least)) continue;
      least = cost;
      const double beyond_mm = std::exp(log_beyond);
      result.chi2_per_dof = 2 * cost / static_cast<double>(rows_.size() - 2);
      result.sensor_distance_mm.reset();
      if (!sigma) continue;
      const double sigma_mm = beyond_mm * *sigma * std::sqrt(std::max(1.0, result.chi2_per_dof));
      if (kKnown * sigma_mm < beyond_mm)
        result.sensor_distance_mm =
            model::Estimate{beyond_mm + lens_.rear_focal_length_mm, sigma_mm};
    }
    return result;
  }

 private:
  // The slope by the median over pairs, with its error from the scatter.
  model::Estimate Slope() const {
    std::vector<double> slopes;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      for (std::size_t j = 0; j < i; ++j) {
        const double apart_mm = rows_[i].reading_mm - rows_[j].reading_mm;
        if (apart_mm != 0) slopes.push_back((rows_[i].log_scale - rows_[j].log_scale) / apart_mm);
      }
    }
    if (slopes.empty()) return {};
    const double slope = Median(slopes);
    double middle_mm = 0, square_mm2 = 0;
    const auto n = static_cast<double>(rows_.size());
    std::vector<double> rests;
    for (const ScaleResidual& row : rows_) {
      middle_mm += row.reading_mm / n;
      rests.push_back(row.log_scale - slope * row.reading_mm);
    }
    const double intercept = Median(rests);
    for (double& rest : rests) rest = std::abs(rest - intercept);
    for (const ScaleResidual& row : rows_) square_mm2 += std::pow(row.reading_mm - middle_mm, 2);
    const double scatter = std::max(1.4826 * Median(rests), kScaleBias);
    return {slope, scatter / std::sqrt(std::max(square_mm2, 1e-300))};
  }

  bool Solve(double* log_a, double* log_beyond, double* cost, std::optional<double>* sigma) const {
    ceres::Problem problem;
    for (const ScaleResidual& row : rows_) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<ScaleResidual, 1, 1, 1>(new ScaleResidual(row)),
          new ceres::CauchyLoss(kCauchyWidth), log_a, log_beyond);
    }
    // Beyond these, the scale is that of the middle within any error, and the numbers overflow.
    problem.SetParameterLowerBound(log_beyond, 0,
                                   std::log(kMinBeyond * lens_.rear_focal_length_mm));
    problem.SetParameterUpperBound(log_beyond, 0,
                                   std::log(kMaxBeyond * lens_.rear_focal_length_mm));
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    options.num_threads = 1;
    options.max_num_iterations = 200;
    options.function_tolerance = 1e-12;
    ceres::Solver::Summary summary;
    SolveOrStop(options, &problem, &summary);
    if (!summary.IsSolutionUsable()) return false;
    *cost = summary.final_cost;
    *sigma = SigmaOfDistance(&problem, {log_a, log_beyond});
    return true;
  }

  // Standard deviation of ln(xf - f2) from the weighted Jacobian; nothing where the scales leave it
  // open. (Ceres::Covariance reports such a matrix as an error on the console.)
  static std::optional<double> SigmaOfDistance(ceres::Problem* problem,
                                               const std::vector<double*>& parameters) {
    ceres::Problem::EvaluateOptions options;
    options.parameter_blocks = parameters;
    ceres::CRSMatrix jacobian;
    if (!problem->Evaluate(options, nullptr, nullptr, nullptr, &jacobian)) return std::nullopt;
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    for (int row = 0; row < jacobian.num_rows; ++row) {
      Eigen::Vector2d by = Eigen::Vector2d::Zero();
      for (int k = jacobian.rows[static_cast<std::size_t>(row)];
           k < jacobian.rows[static_cast<std::size_t>(row) + 1]; ++k) {
        const auto at = static_cast<std::size_t>(k);
        by[jacobian.cols[at]] = jacobian.values[at];
      }
      normal += by * by.transpose();
    }
    // The information on this parameter that the other one leaves.
    if (!(normal(0, 0) > 0)) return std::nullopt;
    const double left = normal(1, 1) - normal(0, 1) * normal(0, 1) / normal(0, 0);
    if (!(left > kMinInformation * normal(1, 1)) || !(normal(1, 1) > 0)) return std::nullopt;
    return 1 / std::sqrt(left);
  }

  const model::ThickLens& lens_;
  std::vector<ScaleResidual> rows_;
  double reading_sigma_mm_ = 0;
};

}  // namespace

MovingScale FitMovingScale(const std::vector<ScaleSample>& samples, const model::ThickLens& lens,
                           model::SweepMotion moves, double sign, double focus_reading_mm,
                           double reading_sigma_mm) {
  return MovingScaleFit(samples, lens, moves, sign, focus_reading_mm, reading_sigma_mm).Run();
}

// Gauss-Newton on ln(scale) = ln(a) + ln(D/xf) - ln(z/zf) in (ln(a), g) from g = slope u.
model::Estimate FitStepLength(const std::vector<ScaleSample>& samples, const model::ThickLens& lens,
                              model::SweepMotion moves, double focus_count,
                              double sensor_distance_mm) {
  constexpr int kRounds = 20;
  const double xf = sensor_distance_mm;
  const double zf = model::FocusDepthMm(lens, xf + lens.lens_thickness_mm);
  const double by_depth = moves == model::SweepMotion::kLens ? 1 / zf : 0;
  const auto n = static_cast<Eigen::Index>(samples.size());
  model::Estimate length{0, std::numeric_limits<double>::infinity()};
  if (samples.size() < kMinSamples) return length;
  Eigen::VectorXd counts(n), logs(n), sigmas(n);
  double most = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const ScaleSample& sample = samples[static_cast<std::size_t>(i)];
    counts[i] = sample.reading_mm - focus_count;
    logs[i] = std::log(sample.scale);
    sigmas[i] = std::hypot(sample.registration.scale_sigma / sample.scale, kScaleBias);
    most = std::max(most, std::abs(counts[i]));
  }
  if (!(most > 0)) return length;
  Eigen::Vector2d found(0, 0);
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(n);
  Eigen::Matrix2d normal;
  double scatter = 1;
  // The first step, from g = 0, is linear regression. D and z stay positive.
  const double longest = 0.9 / (most * std::max(1 / xf, by_depth));
  for (int round = 0; round < kRounds; ++round) {
    normal.setZero();
    Eigen::Vector2d right(0, 0);
    std::vector<double> off;
    for (Eigen::Index i = 0; i < n; ++i) {
      const double moved = found[1] * counts[i];
      const double rest =
          logs[i] - found[0] - std::log1p(moved / xf) + std::log1p(-moved * by_depth);
      const Eigen::Vector2d by(
          1, counts[i] / (xf + moved) + counts[i] * by_depth / (1 - moved * by_depth));
      off.push_back(std::abs(rest) / sigmas[i]);
      const double distance = off.back() / (kCauchyWidth * scatter);
      weights[i] = round == 0 ? 1 : 1 / (1 + distance * distance);
      const double weight = weights[i] / (sigmas[i] * sigmas[i]);
      normal += weight * by * by.transpose();
      right += weight * rest * by;
    }
    if (round > 0) scatter = std::max(1.0, 1.4826 * Median(off));
    const Eigen::LDLT<Eigen::Matrix2d> solver(normal);
    found += solver.solve(right);
    found[1] = std::clamp(found[1], -longest, longest);
    const double variance = solver.solve(Eigen::Vector2d::UnitY()).y();
    length = {found[1], scatter * std::sqrt(std::max(0.0, variance))};
  }
  return length;
}

}  // namespace thicklens::calib
