#include "calib/fit/blur_fit.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "calib/fit/blur_costs.h"
#include "calib/fit/blur_covariance.h"
#include "calib/fit/blur_prediction.h"
#include "calib/registration/cancel_callback.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr double kHuber = 4;  // standard deviations; no weight is lost below
constexpr int kRounds = 4;
// Largest step of the bench offset for its slope, relative to zf - f1.
constexpr double kLargestStep = 0.3;

double HuberWeight(double standardised) {
  const double size = std::abs(standardised);
  return size <= kHuber ? 1 : kHuber / size;
}

class Fit {
 public:
  // There is one `information` for each estimator.
  Fit(const BlurFitSetup& setup, const std::vector<WhitenedCovariance>& information)
      : setup_(setup),
        information_(information),
        sign_(model::DirectionSign(setup.direction)),
        scale_frames_(BlurResiduals::ScaleFrames(setup)) {
    const auto n = static_cast<Eigen::Index>(setup.frames.size());
    parameters_.errors_mm = Eigen::VectorXd::Zero(n);
    weights_.readings = weights_.scales = Eigen::VectorXd::Ones(n);
    for (const BlurSamples& estimator : setup.estimators)
      weights_.estimators.push_back(
          Eigen::VectorXd::Ones(static_cast<Eigen::Index>(estimator.frames.size())));
  }

  // Without frames, only the parameters and their covariance are computed.
  BlurFitResult Run(const BlurFitResult* start, bool wants_frames) {
    if (!Start(start)) return result_;
    for (int round = 0; round < kRounds; ++round) {
      if (!Solve()) return result_;
      if (round + 1 < kRounds && !Reweight()) break;
    }
    if (!Covariance(wants_frames)) return result_;
    if (wants_frames) FillFrames();
    result_.done = true;
    result_.message = "converged";
    return result_;
  }

 private:
  bool Fail(const std::string& message) {
    result_.message = message;
    return false;
  }

  bool FloorIsHeld() const {
    return setup_.floor_variance_px2 && !(setup_.floor_variance_px2->sigma > 0);
  }
  bool FloorIsUncertain() const { return setup_.floor_variance_px2 && !FloorIsHeld(); }
  bool ReadingsAreExact() const { return !(setup_.reading_sigma_mm > 0); }

  double Depth(std::size_t frame) const {
    return parameters_.global[kBenchOffset] +
           sign_ * (setup_.frames[frame].reading_mm -
                    parameters_.errors_mm[static_cast<Eigen::Index>(frame)]);
  }

  bool Start(const BlurFitResult* start) {
    parameters_.softness_px2.clear();
    for (const BlurSamples& estimator : setup_.estimators)
      parameters_.softness_px2.push_back(estimator.held_softness_px2.value_or(0));
    parameters_.global[kBenchOffset] = setup_.offset_mm.value;
    parameters_.global[kFloorVariance] =
        setup_.floor_variance_px2 ? setup_.floor_variance_px2->value : 0.25;
    if (start != nullptr && start->done) {
      parameters_.global.head<3>() = start->values.head<3>();
      if (setup_.floor_variance_px2)
        parameters_.global[kFloorVariance] = setup_.floor_variance_px2->value;
      for (std::size_t m = 0; m < setup_.estimators.size(); ++m) {
        if (!setup_.estimators[m].held_softness_px2 && m < start->softness_px2.size())
          parameters_.softness_px2[m] = start->softness_px2[m];
      }
      return true;
    }
    const auto largest = std::max_element(
        setup_.estimators.begin(), setup_.estimators.end(),
        [](const auto& a, const auto& b) { return a.frames.size() < b.frames.size(); });
    if (largest == setup_.estimators.end() || largest->frames.size() < 4) {
      return Fail(fmt::format("blur was measured on {} frames, but at least 4 are needed",
                              largest == setup_.estimators.end() ? 0 : largest->frames.size()));
    }
    return StartFromParabola(*largest);
  }

  bool StartFromParabola(const BlurSamples& estimator) {
    const auto n = static_cast<Eigen::Index>(estimator.frames.size());
    Eigen::VectorXd depths(n);
    double reference_mm = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
      const std::size_t f = estimator.frames[static_cast<std::size_t>(i)];
      depths[i] = Depth(f);
      reference_mm += depths[i] * setup_.frames[f].scale / static_cast<double>(n);
    }
    const Parabola parabola =
        FitParabola(depths, estimator.variances_px2, estimator.covariance.diagonal().cwiseSqrt(),
                    setup_.reading_sigma_mm);
    const auto found =
        FromParabola(parabola, setup_, reference_mm, parameters_.global[kFloorVariance]);
    if (!found) return Fail("the blur has no minimum in depth above the blur floor");
    parameters_.global[kFocusDepth] = found->focus_depth_mm;
    parameters_.global[kBlurRatio] = found->blur_ratio;
    for (std::size_t m = 0; m < setup_.estimators.size(); ++m) {
      if (setup_.estimators[m].held_softness_px2) continue;
      std::vector<double> rests;
      for (std::size_t i = 0; i < setup_.estimators[m].frames.size(); ++i) {
        const std::size_t f = setup_.estimators[m].frames[i];
        rests.push_back(
            setup_.estimators[m].variances_px2[static_cast<Eigen::Index>(i)] -
            PredictBlur(setup_, parameters_.global, Depth(f), setup_.frames[f].scale).value);
      }
      parameters_.softness_px2[m] = Median(rests);
    }
    return true;
  }

  void Build(const BlurResiduals& residuals, ceres::Problem* problem) {
    double* global = parameters_.global.data();
    problem->AddResidualBlock(new BlurCost(residuals, parameters_), nullptr,
                              BlurCost::Blocks(residuals, &parameters_));
    for (std::size_t m = 0; m < setup_.estimators.size(); ++m) {
      if (setup_.estimators[m].held_softness_px2)
        problem->SetParameterBlockConstant(&parameters_.softness_px2[m]);
    }
    std::vector<int> held = {kBenchOffset};
    if (FloorIsHeld()) held.insert(held.begin(), kFloorVariance);
    problem->SetManifold(global, new ceres::SubsetManifold(kBlurParameters, held));
    if (FloorIsUncertain())
      problem->AddResidualBlock(new FloorCost(*setup_.floor_variance_px2), nullptr, global);
    problem->SetParameterLowerBound(global, kFocusDepth,
                                    1.0001 * setup_.lens.front_focal_length_mm);
  }

  bool Solve() {
    const BlurResiduals residuals(setup_, information_, weights_);
    ceres::Problem problem;
    Build(residuals, &problem);
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    options.linear_solver_type = ceres::DENSE_QR;
    options.num_threads = 1;
    options.max_num_iterations = 100;
    options.function_tolerance = 1e-10;
    options.parameter_tolerance = 1e-10;
    ceres::Solver::Summary summary;
    SolveOrStop(options, &problem, &summary);
    if (!summary.IsSolutionUsable() || !parameters_.global.allFinite() ||
        !SolveErrors(residuals, &parameters_))
      return Fail("the fit of the blur did not converge: " + summary.message);
    parameters_.global[kBlurRatio] = std::abs(parameters_.global[kBlurRatio]);
    return true;
  }

  Eigen::VectorXd EstimatorResiduals(std::size_t m) const {
    const BlurSamples& estimator = setup_.estimators[m];
    Eigen::VectorXd rest(static_cast<Eigen::Index>(estimator.frames.size()));
    for (Eigen::Index i = 0; i < rest.size(); ++i) {
      const std::size_t f = estimator.frames[static_cast<std::size_t>(i)];
      rest[i] = estimator.variances_px2[i] - parameters_.softness_px2[m] -
                PredictBlur(setup_, parameters_.global, Depth(f), setup_.frames[f].scale).value;
    }
    return rest;
  }

  // Does one step of iteratively reweighted least squares. Returns false where no weight changes.
  bool Reweight() {
    double change = 0;
    const auto set = [&change](double* weight, double value) {
      change = std::max(change, std::abs(*weight - value));
      *weight = value;
    };
    for (std::size_t m = 0; m < setup_.estimators.size(); ++m) {
      const Eigen::ArrayXd off =
          (EstimatorResiduals(m).array() /
           (setup_.estimators[m].covariance.diagonal().array() + 1e-12).sqrt())
              .abs();
      // Where a lens follows the law only roughly, single frames are not at fault.
      const double scatter =
          std::max(1.0, 1.4826 * Median(std::vector<double>(off.begin(), off.end())));
      for (Eigen::Index i = 0; i < off.size(); ++i)
        set(&weights_.estimators[m][i], HuberWeight(off[i] / scatter));
    }
    if (!ReadingsAreExact()) {
      for (Eigen::Index f = 0; f < weights_.readings.size(); ++f)
        set(&weights_.readings[f], HuberWeight(parameters_.errors_mm[f] / setup_.reading_sigma_mm));
    }
    const BlurResiduals residuals(setup_, information_, weights_);
    for (const std::size_t f : scale_frames_) {
      set(&weights_.scales[static_cast<Eigen::Index>(f)],
          HuberWeight(residuals.ScaleRest(parameters_, f) / *setup_.frames[f].scale_sigma));
    }
    return change > 1e-3;
  }

  bool Covariance(bool wants_frames) {
    const BlurResiduals residuals(setup_, information_, weights_);
    ReducedProblem reduced = Reduce(residuals, parameters_);
    BlurJacobian jacobian;
    jacobian.free = {kFocusDepth, kBlurRatio};
    if (!FloorIsHeld()) jacobian.free.push_back(kFloorVariance);
    std::vector<Eigen::Index> columns(jacobian.free.begin(), jacobian.free.end());
    for (std::size_t m = 0; m < setup_.estimators.size(); ++m) {
      if (!setup_.estimators[m].held_softness_px2)
        columns.push_back(kBlurParameters + static_cast<Eigen::Index>(m));
    }
    for (Eigen::Index c = kBlurParameters + static_cast<Eigen::Index>(setup_.estimators.size());
         c < residuals.columns(); ++c)
      columns.push_back(c);
    if (FloorIsUncertain()) {
      const Eigen::Index row = reduced.values.size();
      const model::Estimate& floor = *setup_.floor_variance_px2;
      reduced.values.conservativeResize(row + 1);
      reduced.values[row] = (parameters_.global[kFloorVariance] - floor.value) / floor.sigma;
      reduced.jacobian.conservativeResize(row + 1, Eigen::NoChange);
      reduced.jacobian.row(row).setZero();
      reduced.jacobian(row, kFloorVariance) = 1 / floor.sigma;
    }
    jacobian.values = reduced.jacobian(Eigen::all, columns);
    jacobian.residuals = reduced.values;
    jacobian.eliminated = ReadingsAreExact() ? 0 : parameters_.errors_mm.size();
    for (const Eigen::VectorXd& weights : weights_.estimators)
      jacobian.lost_weight += (1 - weights.array()).sum();
    jacobian.lost_weight +=
        (1 - weights_.readings.array()).sum() + (1 - weights_.scales.array()).sum();
    const auto covariance = FillCovariance(jacobian, setup_.reading_sigma_is_known, &result_);
    if (!covariance) return false;
    result_.values = parameters_.global;
    result_.softness_px2 = parameters_.softness_px2;
    if (wants_frames) {
      const Eigen::MatrixXd response =
          ReadingsAreExact() ? Eigen::MatrixXd()
                             : Eigen::MatrixXd(reduced.error_response(Eigen::all, columns));
      result_.reading_error_sigmas_mm =
          result_.error_factor *
          ErrorVariances(residuals, parameters_, response, *covariance).cwiseSqrt();
    }
    return true;
  }

  // Computes the residuals with the readings as written, relative to the errors of estimator and
  // reading together.
  void FillFrames() {
    const auto n = static_cast<Eigen::Index>(setup_.frames.size());
    result_.reading_errors_mm = parameters_.errors_mm;
    result_.residuals = Eigen::VectorXd::Zero(n);
    result_.weights = weights_.readings.cwiseMin(weights_.scales);
    for (std::size_t m = 0; m < setup_.estimators.size(); ++m) {
      const BlurSamples& estimator = setup_.estimators[m];
      for (std::size_t i = 0; i < estimator.frames.size(); ++i) {
        const std::size_t f = estimator.frames[i];
        const auto row = static_cast<Eigen::Index>(f);
        const double as_written_mm =
            parameters_.global[kBenchOffset] + sign_ * setup_.frames[f].reading_mm;
        const BlurPrediction p =
            PredictBlur(setup_, parameters_.global, as_written_mm, setup_.frames[f].scale);
        const auto k = static_cast<Eigen::Index>(i);
        const double sigma =
            std::hypot(std::sqrt(estimator.covariance(k, k)), p.by_depth * setup_.reading_sigma_mm);
        const double rest = estimator.variances_px2[k] - parameters_.softness_px2[m] - p.value;
        const double standardised = rest / std::max(sigma, 1e-9);
        if (std::abs(standardised) > std::abs(result_.residuals[row]))
          result_.residuals[row] = standardised;
        result_.weights[row] = std::min(result_.weights[row], weights_.estimators[m][k]);
      }
    }
  }

  const BlurFitSetup& setup_;
  const std::vector<WhitenedCovariance>& information_;
  double sign_ = 1;
  std::vector<std::size_t> scale_frames_;
  BlurParameters parameters_;
  BlurWeights weights_;
  BlurFitResult result_;
};

}  // namespace

BlurFitResult FitBlur(const BlurFitSetup& setup, const BlurFitResult* start) {
  if (setup.frames.empty()) {
    BlurFitResult none;
    none.message = "no frame is left to fit";
    return none;
  }
  std::vector<WhitenedCovariance> information;  // one inversion for all rounds of all fits
  for (const BlurSamples& estimator : setup.estimators)
    information.emplace_back(estimator.covariance);
  BlurFitResult result = Fit(setup, information).Run(start, true);
  const double offset_sigma_mm = setup.offset_mm.sigma;
  if (!result.done || !(offset_sigma_mm > 0)) return result;
  // The change of the results with the bench offset, by central differences over its own
  // uncertainty. The depths move with the zero, and the focus with them. If it started at the old
  // focus, a fit of a sweep that is short against that error would start outside the sweep.
  const auto moved_by = [&](double move_mm) {
    BlurFitSetup moved = setup;
    moved.offset_mm.value += move_mm;
    BlurFitResult start_there = result;
    start_there.values[kFocusDepth] =
        std::max(result.values[kFocusDepth] + move_mm, 1.001 * setup.lens.front_focal_length_mm);
    return Fit(moved, information).Run(&start_there, false);
  };
  // Where the offset's uncertainty reaches the focal point, a smaller step gives the slope.
  const double step_mm =
      std::min(offset_sigma_mm,
               kLargestStep * (result.values[kFocusDepth] - setup.lens.front_focal_length_mm));
  const BlurFitResult above = moved_by(step_mm);
  const BlurFitResult below = moved_by(-step_mm);
  if (!above.done || !below.done) {
    result.done = false;
    result.message =
        "the fit of the blur does not converge at the ends of the bench offset's uncertainty";
    return result;
  }
  const Eigen::Vector4d slope = (above.values - below.values) / (2 * step_mm);
  result.covariance += slope * slope.transpose() * offset_sigma_mm * offset_sigma_mm;
  return result;
}

}  // namespace thicklens::calib
