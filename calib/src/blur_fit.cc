#include "blur_fit.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace thicklens::calib {
namespace {

constexpr double kPixelBoxVariance = 1.0 / 12;
constexpr double kLossScale = 2.5;  // sigmas
constexpr int kParameters = 5;
enum Parameter { kFocus, kRatio, kFloor, kOffset, kSoftness };
constexpr std::array<const char*, kParameters> kNames = {
    "focus_depth_mm", "blur_ratio", "blur_floor_px", "bench_offset_mm", "target softness"};

// The model, shared by the residual and by the error propagation of the readings.
struct BlurModel {
  double front_focal_mm, aperture_radius_mm, pitch_mm, sign;

  // sigma^2, px^2, at a reading.
  template <typename T>
  T Variance(const T* parameters, const T& reading_mm) const {
    const T& zf = parameters[kFocus];
    const T z = parameters[kOffset] + sign * reading_mm;
    const T k_mm = front_focal_mm * zf / (zf - front_focal_mm);
    const T amplitude = parameters[kRatio] * aperture_radius_mm * k_mm / pitch_mm;
    const T defocus = 1.0 / z - 1.0 / zf;
    const T size = zf / z;
    return parameters[kFloor] + parameters[kSoftness] * size * size +
           amplitude * amplitude * defocus * defocus;
  }
};

struct VarianceResidual {
  BlurModel model;
  BlurSample sample;
  double reference_reading_mm, sigma_px2;

  template <typename T>
  bool operator()(const T* parameters, T* residual) const {
    T predicted = model.Variance(parameters, T(sample.reading_mm));
    if (sample.relative_scale > 0) {
      const double s2 = sample.relative_scale * sample.relative_scale;
      predicted += kPixelBoxVariance -
                   s2 * (model.Variance(parameters, T(reference_reading_mm)) + kPixelBoxVariance);
    }
    residual[0] = (predicted - sample.variance_px2) / sigma_px2;
    return true;
  }
};

struct PriorResidual {
  int parameter;
  double value, sigma;

  template <typename T>
  bool operator()(const T* parameters, T* residual) const {
    residual[0] = (parameters[parameter] - value) / sigma;
    return true;
  }
};

// A sample's standard deviation: the meter's own and what the reading's error does to sigma^2.
double SampleSigma(const BlurModel& model, const std::array<double, kParameters>& parameters,
                   const BlurSample& sample, double reading_sigma_mm) {
  const double step_mm = 1e-3;
  const double slope = (model.Variance(parameters.data(), sample.reading_mm + step_mm) -
                        model.Variance(parameters.data(), sample.reading_mm - step_mm)) /
                       (2 * step_mm);
  return std::hypot(sample.error_px2, slope * reading_sigma_mm);
}

double RobustWeight(double residual) {
  return 1 / (1 + residual * residual / (kLossScale * kLossScale));
}

// The reweighted normal matrix of the free parameters, and chi^2 with its degrees of freedom.
struct Normal {
  Eigen::MatrixXd matrix;
  double chi2 = 0;
  double weight = 0;
};

Normal NormalMatrix(ceres::Problem* problem, std::size_t samples, const std::vector<int>& free) {
  ceres::Problem::EvaluateOptions options;
  options.apply_loss_function = false;
  std::vector<double> residuals;
  ceres::CRSMatrix jacobian;
  problem->Evaluate(options, nullptr, &residuals, nullptr, &jacobian);
  const auto n = static_cast<Eigen::Index>(free.size());
  Normal normal{Eigen::MatrixXd::Zero(n, n)};
  for (int row = 0; row < jacobian.num_rows; ++row) {
    const bool is_sample = static_cast<std::size_t>(row) < samples;
    const double r = residuals[static_cast<std::size_t>(row)];
    const double weight = is_sample ? RobustWeight(r) : 1;
    Eigen::VectorXd derivative = Eigen::VectorXd::Zero(n);
    for (int k = jacobian.rows[static_cast<std::size_t>(row)];
         k < jacobian.rows[static_cast<std::size_t>(row) + 1]; ++k) {
      derivative[jacobian.cols[static_cast<std::size_t>(k)]] =
          jacobian.values[static_cast<std::size_t>(k)];
    }
    normal.matrix += weight * derivative * derivative.transpose();
    // A prior is a measurement too: it counts in chi^2 and in the degrees of freedom.
    normal.chi2 += weight * r * r;
    normal.weight += weight;
  }
  return normal;
}

class Fit {
 public:
  Fit(const std::vector<BlurSample>& samples, const BlurFitSetup& setup)
      : samples_(samples),
        setup_(setup),
        model_{setup.lens.front_focal_length_mm, setup.lens.aperture_radius_mm,
               setup.pixel_pitch_mm, model::DirectionSign(setup.direction)} {}

  BlurFitResult Run() {
    if (!Start()) return result_;
    sigmas_.assign(samples_.size(), 0);
    // The readings' share of the errors depends on the answer: three rounds settle it.
    for (int round = 0; round < 3; ++round) {
      for (std::size_t i = 0; i < samples_.size(); ++i) {
        sigmas_[i] =
            std::max(SampleSigma(model_, parameters_, samples_[i], setup_.reading_sigma_mm), 1e-6);
      }
      if (!Solve(round == 2)) return result_;
    }
    result_.done = true;
    result_.message = "converged";
    return result_;
  }

 private:
  bool Fail(const std::string& message) {
    result_.message = message;
    return false;
  }

  // Kappa and the floor by linear least squares at the start depth.
  bool Start() {
    if (samples_.size() < 4) {
      return Fail(
          fmt::format("blur was measured on {} frames, at least 4 are needed", samples_.size()));
    }
    parameters_[kFocus] = setup_.start_focus_depth_mm;
    parameters_[kOffset] = setup_.offset_mm.value;
    parameters_[kFloor] = setup_.floor_variance_px2 ? setup_.floor_variance_px2->value : 0.25;
    parameters_[kSoftness] = 0;
    parameters_[kRatio] = 1;
    const std::array<double, kParameters> unit = parameters_;
    std::vector<double> ratios;
    for (const BlurSample& s : samples_) {
      const double rise = model_.Variance(unit.data(), s.reading_mm) - parameters_[kFloor];
      const double measured = s.variance_px2 - (s.relative_scale > 0 ? 0 : parameters_[kFloor]);
      if (rise > 0 && measured > 0) ratios.push_back(measured / rise);
    }
    std::sort(ratios.begin(), ratios.end());
    parameters_[kRatio] = ratios.empty() ? 0.5 : std::sqrt(ratios[ratios.size() / 2]);
    return true;
  }

  std::vector<int> Held() const {
    std::vector<int> held;
    if (setup_.floor_variance_px2 && !(setup_.floor_variance_px2->sigma > 0))
      held.push_back(kFloor);
    held.push_back(kOffset);
    if (!setup_.target_softness) held.push_back(kSoftness);
    return held;
  }

  void AddPrior(ceres::Problem* problem, int parameter, const model::Estimate& prior) {
    problem->AddResidualBlock(new ceres::AutoDiffCostFunction<PriorResidual, 1, kParameters>(
                                  new PriorResidual{parameter, prior.value, prior.sigma}),
                              nullptr, parameters_.data());
  }

  bool Solve(bool last) {
    ceres::Problem problem;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      problem.AddResidualBlock(
          new ceres::AutoDiffCostFunction<VarianceResidual, 1, kParameters>(
              new VarianceResidual{model_, samples_[i], setup_.reference_reading_mm, sigmas_[i]}),
          new ceres::CauchyLoss(kLossScale), parameters_.data());
    }
    if (setup_.floor_variance_px2 && setup_.floor_variance_px2->sigma > 0) {
      AddPrior(&problem, kFloor, *setup_.floor_variance_px2);
    }
    const std::vector<int> held = Held();
    if (!held.empty()) {
      problem.SetManifold(parameters_.data(), new ceres::SubsetManifold(kParameters, held));
    }
    problem.SetParameterLowerBound(parameters_.data(), kFocus,
                                   1.0001 * setup_.lens.front_focal_length_mm);
    problem.SetParameterLowerBound(parameters_.data(), kRatio, 0);

    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    options.max_num_iterations = 200;
    options.function_tolerance = 1e-12;
    options.parameter_tolerance = 1e-12;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (!summary.IsSolutionUsable() || !std::isfinite(parameters_[kFocus])) {
      return Fail("the fit of the blur did not converge: " + summary.message);
    }
    return !last || Finish(&problem, held);
  }

  bool Finish(ceres::Problem* problem, const std::vector<int>& held) {
    std::vector<int> free;
    for (int i = 0; i < kParameters; ++i) {
      if (std::find(held.begin(), held.end(), i) == held.end()) free.push_back(i);
    }
    const Normal normal = NormalMatrix(problem, samples_.size(), free);
    const double dof = normal.weight - static_cast<double>(free.size());
    if (!(dof > 0)) return Fail("too few frames fit the blur law to tell its errors");
    result_.chi2_per_dof = normal.chi2 / dof;

    // Rank in units of the parameters themselves: with each column scaled to 1, a small eigenvalue
    // is a combination that the data leave free.
    const Eigen::VectorXd scale = normal.matrix.diagonal().cwiseSqrt();
    if (!(scale.minCoeff() > 0)) return Fail("the blur does not depend on every parameter");
    const Eigen::MatrixXd scaled =
        scale.cwiseInverse().asDiagonal() * normal.matrix * scale.cwiseInverse().asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
    if (!(eigen.eigenvalues()[0] > 1e-10)) {
      for (std::size_t i = 0; i < free.size(); ++i) {
        if (std::abs(eigen.eigenvectors()(static_cast<Eigen::Index>(i), 0)) < 0.3) continue;
        result_.weak_direction += (result_.weak_direction.empty() ? "" : " with ") +
                                  std::string(kNames[static_cast<std::size_t>(free[i])]);
      }
      return Fail("the data do not tell apart: " + result_.weak_direction);
    }
    const Eigen::MatrixXd covariance = scale.cwiseInverse().asDiagonal() * scaled.inverse() *
                                       scale.cwiseInverse().asDiagonal() *
                                       std::max(1.0, result_.chi2_per_dof);
    for (int i = 0; i < 4; ++i) result_.values[i] = parameters_[static_cast<std::size_t>(i)];
    for (std::size_t i = 0; i < free.size(); ++i) {
      for (std::size_t j = 0; j < free.size(); ++j) {
        if (free[i] < 4 && free[j] < 4) {
          result_.covariance(free[i], free[j]) =
              covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
        }
      }
    }
    result_.target_softness_px2 = parameters_[kSoftness];
    FillSamples();
    return true;
  }

  void FillSamples() {
    const double reference_px2 =
        model_.Variance(parameters_.data(), setup_.reference_reading_mm) + kPixelBoxVariance;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      double residual = 0;
      VarianceResidual{model_, samples_[i], setup_.reference_reading_mm, sigmas_[i]}(
          parameters_.data(), &residual);
      result_.weights.push_back(RobustWeight(residual));
      const double s2 = samples_[i].relative_scale * samples_[i].relative_scale;
      result_.variances_px2.push_back(samples_[i].variance_px2 +
                                      (s2 > 0 ? s2 * reference_px2 - kPixelBoxVariance : 0));
    }
  }

  const std::vector<BlurSample>& samples_;
  const BlurFitSetup& setup_;
  BlurModel model_;
  std::array<double, kParameters> parameters_{};
  std::vector<double> sigmas_;
  BlurFitResult result_;
};

}  // namespace

BlurFitResult FitBlur(const std::vector<BlurSample>& samples, const BlurFitSetup& setup) {
  BlurFitResult result = Fit(samples, setup).Run();
  const double offset_sigma_mm = setup.offset_mm.sigma;
  if (!result.done || !(offset_sigma_mm > 0)) return result;
  // How the answer moves with the bench zero, by central differences over its own uncertainty.
  BlurFitSetup moved = setup;
  moved.offset_mm.value = setup.offset_mm.value + offset_sigma_mm;
  const BlurFitResult above = Fit(samples, moved).Run();
  moved.offset_mm.value = setup.offset_mm.value - offset_sigma_mm;
  const BlurFitResult below = Fit(samples, moved).Run();
  if (!above.done || !below.done) {
    result.done = false;
    result.message =
        "the fit of the blur does not converge at the ends of the bench zero's uncertainty";
    return result;
  }
  const Eigen::Vector4d slope = (above.values - below.values) / (2 * offset_sigma_mm);
  result.covariance += slope * slope.transpose() * offset_sigma_mm * offset_sigma_mm;
  return result;
}

}  // namespace thicklens::calib
