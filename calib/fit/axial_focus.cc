#include "calib/fit/axial_focus.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "calib/fit/blur_prediction.h"
#include "calib/fit/whitened_covariance.h"
#include "thicklens/base/cancel.h"

namespace thicklens::calib {
namespace {

constexpr int kAxialSteps = 40;
constexpr Eigen::Index kPerAxis = 3;  // zf, kappa, c
constexpr Eigen::Index kOfBothAxes = 2 * kPerAxis;
constexpr double kConverged = 1e-10;  // part of the cost
constexpr const char* kAxisNames[] = {"x", "y"};

// The samples of one axis alone.
BlurSamples AlongAxis(const std::vector<std::size_t>& frames, const AxialBlur& blur,
                      Eigen::Index axis) {
  BlurSamples samples;
  samples.frames = frames;
  std::vector<Eigen::Index> rows;
  for (Eigen::Index i = 0; i < blur.variances_px2.cols(); ++i) rows.push_back(2 * i + axis);
  samples.variances_px2 = blur.variances_px2.row(axis).transpose();
  samples.covariance = blur.covariance(rows, rows);
  return samples;
}

// Levenberg and Marquardt in (zf, kappa, c) of x and of y and the readings' errors.
class AxialFit {
 public:
  AxialFit(const BlurFitSetup& setup, const std::vector<std::size_t>& frames, const AxialBlur& blur)
      : setup_(setup),
        frames_(frames),
        blur_(blur),
        n_(static_cast<Eigen::Index>(frames.size())),
        has_errors_(setup.reading_sigma_mm > 0),
        information_(blur.covariance) {}

  AxialFocus Run() {
    if (!Start()) return result_;
    const Eigen::VectorXd factors = information_.Factors(weights_);
    double damping = 1e-6;
    Eigen::MatrixXd jacobian;
    Eigen::VectorXd rest = Residuals(parameters_, factors, &jacobian);
    for (int step = 0; step < kAxialSteps; ++step) {
      ThrowIfCancelled();
      const Eigen::MatrixXd normal = jacobian.transpose() * jacobian;
      const Eigen::VectorXd gradient = jacobian.transpose() * rest;
      Eigen::MatrixXd damped = normal;
      damped.diagonal() *= 1 + damping;
      const Eigen::VectorXd next = parameters_ - damped.ldlt().solve(gradient);
      Eigen::MatrixXd next_jacobian;
      const Eigen::VectorXd next_rest = Residuals(next, factors, &next_jacobian);
      const double gained = rest.squaredNorm() - next_rest.squaredNorm();
      if (!(gained >= 0)) {
        damping = std::max(1e-4, 10 * damping);
        if (damping > 1e8) break;
        continue;
      }
      const bool converged = gained <= kConverged * rest.squaredNorm();
      parameters_ = next;
      rest = next_rest;
      jacobian = std::move(next_jacobian);
      damping = std::max(1e-9, 0.1 * damping);
      if (converged) break;
    }
    Finish(rest, jacobian);
    return result_;
  }

 private:
  // The laws of each axis alone are the start, and decide on the weights of the frames.
  bool Start() {
    parameters_ = Eigen::VectorXd::Zero(kOfBothAxes + (has_errors_ ? n_ : 0));
    frame_weights_ = Eigen::VectorXd::Ones(n_);
    for (Eigen::Index axis = 0; axis < 2; ++axis) {
      BlurFitSetup alone = setup_;
      alone.offset_mm.sigma = 0;
      alone.estimators = {AlongAxis(frames_, blur_, axis)};
      const BlurFitResult fit = FitBlur(alone);
      if (!fit.done) {
        result_.message = std::string("along ") + kAxisNames[axis] + ": " + fit.message;
        return false;
      }
      parameters_.segment(kPerAxis * axis, kPerAxis) << fit.values[kFocusDepth],
          fit.values[kBlurRatio], fit.softness_px2[0];
      for (Eigen::Index i = 0; i < n_; ++i) {
        const auto f = static_cast<Eigen::Index>(frames_[static_cast<std::size_t>(i)]);
        frame_weights_[i] = std::min(frame_weights_[i], fit.weights[f]);
        if (has_errors_) parameters_[kOfBothAxes + i] += 0.5 * fit.reading_errors_mm[f];
      }
    }
    weights_.resize(2 * n_);
    for (Eigen::Index i = 0; i < n_; ++i) weights_.segment<2>(2 * i).setConstant(frame_weights_[i]);
    return true;
  }

  Eigen::VectorXd Residuals(const Eigen::VectorXd& parameters, const Eigen::VectorXd& factors,
                            Eigen::MatrixXd* jacobian) const {
    const double sign = model::DirectionSign(setup_.direction);
    Eigen::MatrixXd blur = Eigen::MatrixXd::Zero(2 * n_, 1 + parameters.size());
    for (Eigen::Index i = 0; i < n_; ++i) {
      const FitFrame& frame = setup_.frames[frames_[static_cast<std::size_t>(i)]];
      const double error_mm = has_errors_ ? parameters[kOfBothAxes + i] : 0;
      const double depth_mm = setup_.offset_mm.value + sign * (frame.reading_mm - error_mm);
      for (Eigen::Index axis = 0; axis < 2; ++axis) {
        const Eigen::Index row = 2 * i + axis, first = kPerAxis * axis;
        Eigen::Vector4d global = Eigen::Vector4d::Zero();
        global[kFocusDepth] = parameters[first];
        global[kBlurRatio] = parameters[first + 1];
        global[kFloorVariance] = setup_.floor_variance_px2->value;
        global[kBenchOffset] = setup_.offset_mm.value;
        const BlurPrediction law = PredictBlur(setup_, global, depth_mm, frame.scale);
        blur(row, 0) = law.value + parameters[first + 2] - blur_.variances_px2(axis, i);
        blur(row, 1 + first) = law.by_global[kFocusDepth];
        blur(row, 2 + first) = law.by_global[kBlurRatio];
        blur(row, 3 + first) = 1;
        if (has_errors_) blur(row, 1 + kOfBothAxes + i) = -sign * law.by_depth;
      }
    }
    const Eigen::MatrixXd white = information_.Whitened(factors.asDiagonal() * blur);
    const Eigen::Index errors = has_errors_ ? n_ : 0;
    Eigen::VectorXd rest = Eigen::VectorXd::Zero(2 * n_ + errors);
    *jacobian = Eigen::MatrixXd::Zero(2 * n_ + errors, parameters.size());
    rest.head(2 * n_) = white.col(0);
    jacobian->topRows(2 * n_) = white.rightCols(parameters.size());
    for (Eigen::Index i = 0; i < errors; ++i) {
      const double weight = std::sqrt(frame_weights_[i]) / setup_.reading_sigma_mm;
      rest[2 * n_ + i] = weight * parameters[kOfBothAxes + i];
      (*jacobian)(2 * n_ + i, kOfBothAxes + i) = weight;
    }
    return rest;
  }

  void Finish(const Eigen::VectorXd& rest, const Eigen::MatrixXd& jacobian) {
    // Each error has a reading of its own.
    const double freedom = 2 * frame_weights_.sum() - static_cast<double>(kOfBothAxes);
    if (!(freedom > 0.5)) {
      result_.message = "too few frames follow the blur laws to estimate their errors";
      return;
    }
    const Eigen::MatrixXd normal = jacobian.transpose() * jacobian;
    const Eigen::VectorXd unit = normal.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    const Eigen::LLT<Eigen::MatrixXd> factor(unit.asDiagonal() * normal * unit.asDiagonal());
    if (factor.info() != Eigen::Success || !parameters_.allFinite()) {
      result_.message = "the fit of the blur along x and along y did not converge";
      return;
    }
    Eigen::MatrixXd columns = Eigen::MatrixXd::Identity(normal.rows(), kOfBothAxes);
    columns = unit.asDiagonal() * factor.solve(unit.asDiagonal() * columns);
    result_.chi2_per_dof = rest.squaredNorm() / freedom;
    const Eigen::MatrixXd covariance =
        std::max(1.0, result_.chi2_per_dof) * columns.topRows(kOfBothAxes);
    for (Eigen::Index axis = 0; axis < 2; ++axis) {
      const Eigen::Index first = kPerAxis * axis;
      const auto a = static_cast<std::size_t>(axis);
      result_.focus_depth_mm[a] = {parameters_[first], std::sqrt(covariance(first, first))};
      result_.blur_ratio[a] = {std::abs(parameters_[first + 1]),
                               std::sqrt(covariance(first + 1, first + 1))};
    }
    result_.difference_mm = {
        parameters_[0] - parameters_[kPerAxis],
        std::sqrt(std::max(
            0.0, covariance(0, 0) + covariance(kPerAxis, kPerAxis) - 2 * covariance(0, kPerAxis)))};
    result_.done = true;
    result_.message = "converged";
  }

  const BlurFitSetup& setup_;
  const std::vector<std::size_t>& frames_;
  const AxialBlur& blur_;
  Eigen::Index n_;
  bool has_errors_;
  WhitenedCovariance information_;
  Eigen::VectorXd parameters_;
  Eigen::VectorXd frame_weights_, weights_;  // per frame, and per value of V
  AxialFocus result_;
};

}  // namespace

AxialFocus FitAxialFocus(const BlurFitSetup& setup, const std::vector<std::size_t>& frames,
                         const AxialBlur& blur) {
  return AxialFit(setup, frames, blur).Run();
}

std::vector<std::size_t> SamplesOnParabolas(const BlurFitSetup& setup,
                                            const std::vector<std::size_t>& frames,
                                            const AxialBlur& blur) {
  const double sign = model::DirectionSign(setup.direction);
  Eigen::VectorXd depths(static_cast<Eigen::Index>(frames.size()));
  for (std::size_t i = 0; i < frames.size(); ++i)
    depths[static_cast<Eigen::Index>(i)] =
        setup.offset_mm.value + sign * setup.frames[frames[i]].reading_mm;
  std::vector<bool> follows(frames.size(), true);
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    const BlurSamples samples = AlongAxis(frames, blur, axis);
    const Parabola parabola =
        FitParabola(depths, samples.variances_px2, samples.covariance.diagonal().cwiseSqrt(),
                    setup.reading_sigma_mm);
    if (!parabola.done) continue;
    for (std::size_t i = 0; i < frames.size(); ++i) follows[i] = follows[i] && parabola.follows[i];
  }
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    if (follows[i]) kept.push_back(i);
  }
  return kept;
}

}  // namespace thicklens::calib
