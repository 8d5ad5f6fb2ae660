#include "blur_fit.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "edge_pixels.h"

namespace thicklens::calib {
namespace {

constexpr double kHuber = 4;  // standard deviations; no weight is lost below
constexpr int kRounds = 4;
constexpr std::array<const char*, kBlurParameters> kNames = {"focus_depth_mm", "blur_ratio",
                                                             "blur_floor_px", "bench_offset_mm"};

double HuberWeight(double standardised) {
  const double size = std::abs(standardised);
  return size <= kHuber ? 1 : kHuber / size;
}

// chi^2 per degree of freedom that chance exceeds once in a hundred (Wilson and Hilferty 1931).
double LargestByChance(double freedom) {
  const double spread = 2 / (9 * freedom);
  return std::pow(1 - spread + 2.326 * std::sqrt(spread), 3);
}

// Everything that is fitted. Readings' errors e: the bench stood at reading - e.
struct Parameters {
  Eigen::Vector4d global{0, 0, 0, 0};
  std::vector<double> softness;        // of each meter
  Eigen::Vector3d scale_law{1, 0, 0};  // 1/scale = l0 + l1 x + l2 x^2
  Eigen::VectorXd errors_mm;
};

// The readings, and what maps them to x in [-1, 1] for the scale's law.
struct Bench {
  double sign = 1, middle_mm = 0, half_range_mm = 1;
};

// V of a frame without c, and its derivatives.
struct Prediction {
  double value = 0;
  Eigen::Vector4d by_global{0, 0, 0, 0};
  double by_depth = 0;
};

Prediction Predict(const BlurFitSetup& setup, const Eigen::Vector4d& global, double depth_mm,
                   double scale) {
  const double kappa = global[kBlurRatio], zf = global[kFocusDepth];
  const double s2 = 1 / (scale * scale);
  const double unit = DefocusVariance(setup, zf, depth_mm);
  const double step_mm = 1e-5 * zf;
  const auto central = [&](double zf_step, double z_step) {
    return (DefocusVariance(setup, zf + zf_step, depth_mm + z_step) -
            DefocusVariance(setup, zf - zf_step, depth_mm - z_step)) /
           (2 * step_mm);
  };
  Prediction p;
  p.value = s2 * (global[kFloorVariance] + kappa * kappa * unit);
  p.by_global[kFocusDepth] = s2 * kappa * kappa * central(step_mm, 0);
  p.by_global[kBlurRatio] = s2 * 2 * kappa * unit;
  p.by_global[kFloorVariance] = s2;
  p.by_depth = s2 * kappa * kappa * central(0, step_mm);
  p.by_global[kBenchOffset] = p.by_depth;
  return p;
}

// One meter: L^-1 (V_model - V), L L^T its weighted covariance. Blocks: global, c, errors.
class MeterCost : public ceres::CostFunction {
 public:
  MeterCost(const BlurFitSetup& setup, const BlurSamples& meter, Eigen::MatrixXd whitening)
      : setup_(setup), meter_(meter), whitening_(std::move(whitening)) {
    set_num_residuals(static_cast<int>(meter.frames.size()));
    *mutable_parameter_block_sizes() = {kBlurParameters, 1, static_cast<int>(setup.frames.size())};
  }

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Eigen::Vector4d> global(blocks[0]);
    const auto n = static_cast<Eigen::Index>(meter_.frames.size());
    const double sign = model::DirectionSign(setup_.direction);
    Eigen::VectorXd raw(n);
    Eigen::MatrixXd by_global(n, 4),
        by_error = Eigen::MatrixXd::Zero(n, static_cast<Eigen::Index>(setup_.frames.size()));
    for (Eigen::Index i = 0; i < n; ++i) {
      const std::size_t f = meter_.frames[static_cast<std::size_t>(i)];
      const FitFrame& frame = setup_.frames[f];
      const double depth_mm = global[kBenchOffset] + sign * (frame.reading_mm - blocks[2][f]);
      if (!(depth_mm > 0)) return false;
      const Prediction p = Predict(setup_, global, depth_mm, frame.scale);
      raw[i] = p.value + blocks[1][0] - meter_.variances_px2[i];
      by_global.row(i) = p.by_global.transpose();
      by_error(i, static_cast<Eigen::Index>(f)) = -sign * p.by_depth;
    }
    Eigen::Map<Eigen::VectorXd>(residuals, n) = Whiten(raw);
    if (jacobians == nullptr) return true;
    const auto put = [&](int block, const Eigen::MatrixXd& derivative) {
      if (jacobians[block] == nullptr) return;
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      const Eigen::MatrixXd white = Whiten(derivative);
      Eigen::Map<RowMajor>(jacobians[block], n, derivative.cols()) = white;
    };
    put(0, by_global);
    if (jacobians[1] != nullptr)
      Eigen::Map<Eigen::VectorXd>(jacobians[1], n) = Whiten(Eigen::VectorXd::Ones(n));
    put(2, by_error);
    return true;
  }

 private:
  Eigen::MatrixXd Whiten(const Eigen::MatrixXd& raw) const {
    return whitening_.triangularView<Eigen::Lower>().solve(raw);
  }

  const BlurFitSetup& setup_;
  const BlurSamples& meter_;
  Eigen::MatrixXd whitening_;
};

// scale (l0 + l1 x + l2 x^2) - 1, x the believed reading. Blocks: law, errors.
class ScaleCost : public ceres::CostFunction {
 public:
  ScaleCost(const BlurFitSetup& setup, const Bench& bench, std::vector<std::size_t> frames,
            Eigen::VectorXd weights)
      : setup_(setup), bench_(bench), frames_(std::move(frames)), weights_(std::move(weights)) {
    set_num_residuals(static_cast<int>(frames_.size()));
    *mutable_parameter_block_sizes() = {3, static_cast<int>(setup.frames.size())};
  }

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const std::size_t all = setup_.frames.size();
    if (jacobians != nullptr && jacobians[1] != nullptr)
      std::fill_n(jacobians[1], all * frames_.size(), 0.0);
    for (std::size_t i = 0; i < frames_.size(); ++i) {
      const FitFrame& frame = setup_.frames[frames_[i]];
      const double x =
          (frame.reading_mm - blocks[1][frames_[i]] - bench_.middle_mm) / bench_.half_range_mm;
      const double weight = std::sqrt(weights_[static_cast<Eigen::Index>(i)]) / *frame.scale_sigma;
      const double* law = blocks[0];
      residuals[i] = weight * (frame.scale * (law[0] + x * (law[1] + x * law[2])) - 1);
      if (jacobians == nullptr) continue;
      if (jacobians[0] != nullptr) {
        for (int p = 0; p < 3; ++p)
          jacobians[0][3 * i + static_cast<std::size_t>(p)] = weight * frame.scale * std::pow(x, p);
      }
      if (jacobians[1] != nullptr) {
        jacobians[1][all * i + frames_[i]] =
            -weight * frame.scale * (law[1] + 2 * x * law[2]) / bench_.half_range_mm;
      }
    }
    return true;
  }

 private:
  const BlurFitSetup& setup_;
  const Bench& bench_;
  std::vector<std::size_t> frames_;
  Eigen::VectorXd weights_;
};

// Diagonal prior on a whole block: weight_i (x_i - value_i).
class PriorCost : public ceres::CostFunction {
 public:
  PriorCost(int size, std::vector<std::pair<int, double>> weights, double value)
      : weights_(std::move(weights)), value_(value) {
    set_num_residuals(static_cast<int>(weights_.size()));
    *mutable_parameter_block_sizes() = {size};
  }
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const auto size = static_cast<std::size_t>(parameter_block_sizes()[0]);
    for (std::size_t i = 0; i < weights_.size(); ++i) {
      const auto [index, weight] = weights_[i];
      residuals[i] = weight * (blocks[0][index] - value_);
      if (jacobians == nullptr || jacobians[0] == nullptr) continue;
      std::fill_n(jacobians[0] + size * i, size, 0.0);
      jacobians[0][size * i + static_cast<std::size_t>(index)] = weight;
    }
    return true;
  }

 private:
  std::vector<std::pair<int, double>> weights_;
  double value_;
};

class Fit {
 public:
  explicit Fit(const BlurFitSetup& setup) : setup_(setup) {
    bench_.sign = model::DirectionSign(setup.direction);
    double low = setup.frames.front().reading_mm, high = low;
    for (const FitFrame& frame : setup.frames) {
      low = std::min(low, frame.reading_mm);
      high = std::max(high, frame.reading_mm);
    }
    bench_.middle_mm = 0.5 * (low + high);
    bench_.half_range_mm = std::max(0.5 * (high - low), 1e-9);
    const auto n = static_cast<Eigen::Index>(setup.frames.size());
    parameters_.errors_mm = Eigen::VectorXd::Zero(n);
    prior_weights_ = scale_weights_ = Eigen::VectorXd::Ones(n);
    for (std::size_t f = 0; f < setup.frames.size(); ++f) {
      if (setup.frames[f].scale_sigma) scale_frames_.push_back(f);
    }
    // A law of three terms needs more than three frames to say anything of their errors.
    if (scale_frames_.size() < 6 || !(setup.reading_sigma_mm > 0)) scale_frames_.clear();
    for (const BlurSamples& meter : setup.meters)
      meter_weights_.push_back(
          Eigen::VectorXd::Ones(static_cast<Eigen::Index>(meter.frames.size())));
  }

  BlurFitResult Run(const BlurFitResult* start) {
    if (!Start(start)) return result_;
    for (int round = 0; round < kRounds; ++round) {
      if (!Solve()) return result_;
      if (round + 1 < kRounds && !Reweight()) break;
    }
    if (!Covariance()) return result_;
    FillFrames();
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
  bool ReadingsAreExact() const { return !(setup_.reading_sigma_mm > 0); }

  double Depth(std::size_t frame) const {
    return parameters_.global[kBenchOffset] +
           bench_.sign * (setup_.frames[frame].reading_mm -
                          parameters_.errors_mm[static_cast<Eigen::Index>(frame)]);
  }

  bool Start(const BlurFitResult* start) {
    parameters_.softness.clear();
    for (const BlurSamples& meter : setup_.meters)
      parameters_.softness.push_back(meter.held_softness_px2.value_or(0));
    parameters_.global[kBenchOffset] = setup_.offset_mm.value;
    parameters_.global[kFloorVariance] =
        setup_.floor_variance_px2 ? setup_.floor_variance_px2->value : 0.25;
    if (start != nullptr && start->done) {
      parameters_.global.head<3>() = start->values.head<3>();
      if (setup_.floor_variance_px2)
        parameters_.global[kFloorVariance] = setup_.floor_variance_px2->value;
      for (std::size_t m = 0; m < setup_.meters.size(); ++m) {
        if (!setup_.meters[m].held_softness_px2 && m < start->softness_px2.size())
          parameters_.softness[m] = start->softness_px2[m];
      }
      return true;
    }
    const auto largest = std::max_element(
        setup_.meters.begin(), setup_.meters.end(),
        [](const auto& a, const auto& b) { return a.frames.size() < b.frames.size(); });
    if (largest == setup_.meters.end() || largest->frames.size() < 4) {
      return Fail(fmt::format("blur was measured on {} frames, at least 4 are needed",
                              largest == setup_.meters.end() ? 0 : largest->frames.size()));
    }
    return StartFromParabola(*largest);
  }

  bool StartFromParabola(const BlurSamples& meter) {
    const auto n = static_cast<Eigen::Index>(meter.frames.size());
    Eigen::VectorXd depths(n);
    double reference_mm = 0;
    for (Eigen::Index i = 0; i < n; ++i) {
      const std::size_t f = meter.frames[static_cast<std::size_t>(i)];
      depths[i] = Depth(f);
      reference_mm += depths[i] * setup_.frames[f].scale / static_cast<double>(n);
    }
    const Parabola parabola =
        FitParabola(depths, meter.variances_px2, meter.covariance.diagonal().cwiseSqrt(),
                    setup_.reading_sigma_mm);
    const auto found =
        FromParabola(parabola, setup_, reference_mm, parameters_.global[kFloorVariance]);
    if (!found) return Fail("the blur has no minimum in depth above the lens floor");
    parameters_.global[kFocusDepth] = found->focus_depth_mm;
    parameters_.global[kBlurRatio] = found->blur_ratio;
    for (std::size_t m = 0; m < setup_.meters.size(); ++m) {
      if (setup_.meters[m].held_softness_px2) continue;
      std::vector<double> rests;
      for (std::size_t i = 0; i < setup_.meters[m].frames.size(); ++i) {
        const std::size_t f = setup_.meters[m].frames[i];
        rests.push_back(
            setup_.meters[m].variances_px2[static_cast<Eigen::Index>(i)] -
            Predict(setup_, parameters_.global, Depth(f), setup_.frames[f].scale).value);
      }
      parameters_.softness[m] = Median(rests);
    }
    return true;
  }

  void Build(ceres::Problem* problem) {
    double* global = parameters_.global.data();
    double* errors = parameters_.errors_mm.data();
    const auto n = static_cast<int>(setup_.frames.size());
    problem->AddParameterBlock(global, kBlurParameters);
    problem->AddParameterBlock(errors, n);
    for (std::size_t m = 0; m < setup_.meters.size(); ++m) {
      const BlurSamples& meter = setup_.meters[m];
      const Eigen::VectorXd root = meter_weights_[m].cwiseSqrt().cwiseInverse();
      const Eigen::MatrixXd weighted = root.asDiagonal() * meter.covariance * root.asDiagonal();
      problem->AddResidualBlock(new MeterCost(setup_, meter, Root(weighted)), nullptr, global,
                                &parameters_.softness[m], errors);
      if (meter.held_softness_px2) problem->SetParameterBlockConstant(&parameters_.softness[m]);
    }
    if (!scale_frames_.empty()) {
      Eigen::VectorXd weights(static_cast<Eigen::Index>(scale_frames_.size()));
      for (std::size_t i = 0; i < scale_frames_.size(); ++i)
        weights[static_cast<Eigen::Index>(i)] =
            scale_weights_[static_cast<Eigen::Index>(scale_frames_[i])];
      problem->AddResidualBlock(new ScaleCost(setup_, bench_, scale_frames_, weights), nullptr,
                                parameters_.scale_law.data(), errors);
    }
    if (ReadingsAreExact()) {
      problem->SetParameterBlockConstant(errors);
    } else {
      std::vector<std::pair<int, double>> weights;
      for (int i = 0; i < n; ++i)
        weights.emplace_back(i, std::sqrt(prior_weights_[i]) / setup_.reading_sigma_mm);
      problem->AddResidualBlock(new PriorCost(n, weights, 0), nullptr, errors);
    }
    std::vector<int> held = {kBenchOffset};
    if (FloorIsHeld()) held.insert(held.begin(), kFloorVariance);
    problem->SetManifold(global, new ceres::SubsetManifold(kBlurParameters, held));
    if (setup_.floor_variance_px2 && !FloorIsHeld()) {
      problem->AddResidualBlock(
          new PriorCost(kBlurParameters, {{kFloorVariance, 1 / setup_.floor_variance_px2->sigma}},
                        setup_.floor_variance_px2->value),
          nullptr, global);
    }
    problem->SetParameterLowerBound(global, kFocusDepth,
                                    1.0001 * setup_.lens.front_focal_length_mm);
  }

  // A factor L with L L^T = covariance; a relative measurement's own reference has no error and
  // would make it singular: a hair on the diagonal keeps it whole.
  static Eigen::MatrixXd Root(Eigen::MatrixXd covariance) {
    covariance.diagonal().array() += 1e-9 * covariance.diagonal().maxCoeff() + 1e-12;
    return covariance.llt().matrixL();
  }

  bool Solve() {
    ceres::Problem problem;
    Build(&problem);
    ceres::Solver::Options options;
    options.logging_type = ceres::SILENT;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.num_threads = 1;
    options.max_num_iterations = 100;
    options.function_tolerance = 1e-10;
    options.parameter_tolerance = 1e-10;
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    if (!summary.IsSolutionUsable() || !parameters_.global.allFinite())
      return Fail("the fit of the blur did not converge: " + summary.message);
    parameters_.global[kBlurRatio] = std::abs(parameters_.global[kBlurRatio]);
    return true;
  }

  Eigen::VectorXd MeterResiduals(std::size_t m) const {
    const BlurSamples& meter = setup_.meters[m];
    Eigen::VectorXd rest(static_cast<Eigen::Index>(meter.frames.size()));
    for (Eigen::Index i = 0; i < rest.size(); ++i) {
      const std::size_t f = meter.frames[static_cast<std::size_t>(i)];
      rest[i] = meter.variances_px2[i] - parameters_.softness[m] -
                Predict(setup_, parameters_.global, Depth(f), setup_.frames[f].scale).value;
    }
    return rest;
  }

  // Iteratively reweighted least squares; false where no weight changes.
  bool Reweight() {
    double change = 0;
    const auto set = [&change](double* weight, double value) {
      change = std::max(change, std::abs(*weight - value));
      *weight = value;
    };
    for (std::size_t m = 0; m < setup_.meters.size(); ++m) {
      const Eigen::ArrayXd off = (MeterResiduals(m).array() /
                                  (setup_.meters[m].covariance.diagonal().array() + 1e-12).sqrt())
                                     .abs();
      // Where a lens follows the law only roughly, that is no fault of single frames.
      const double scatter =
          std::max(1.0, 1.4826 * Median(std::vector<double>(off.begin(), off.end())));
      for (Eigen::Index i = 0; i < off.size(); ++i)
        set(&meter_weights_[m][i], HuberWeight(off[i] / scatter));
    }
    if (!ReadingsAreExact()) {
      for (Eigen::Index f = 0; f < prior_weights_.size(); ++f)
        set(&prior_weights_[f], HuberWeight(parameters_.errors_mm[f] / setup_.reading_sigma_mm));
    }
    for (const std::size_t f : scale_frames_) {
      const double x = (setup_.frames[f].reading_mm -
                        parameters_.errors_mm[static_cast<Eigen::Index>(f)] - bench_.middle_mm) /
                       bench_.half_range_mm;
      const Eigen::Vector3d& law = parameters_.scale_law;
      const double rest = setup_.frames[f].scale * (law[0] + x * (law[1] + x * law[2])) - 1;
      set(&scale_weights_[static_cast<Eigen::Index>(f)],
          HuberWeight(rest / *setup_.frames[f].scale_sigma));
    }
    return change > 1e-3;
  }

  bool Covariance() {
    ceres::Problem problem;
    Build(&problem);
    ceres::Problem::EvaluateOptions options;
    options.parameter_blocks = {parameters_.global.data()};
    std::size_t softness = 0;
    for (std::size_t m = 0; m < setup_.meters.size(); ++m) {
      if (setup_.meters[m].held_softness_px2) continue;
      options.parameter_blocks.push_back(&parameters_.softness[m]);
      ++softness;
    }
    if (!ReadingsAreExact()) options.parameter_blocks.push_back(parameters_.errors_mm.data());
    if (!scale_frames_.empty()) options.parameter_blocks.push_back(parameters_.scale_law.data());
    std::vector<double> residuals;
    ceres::CRSMatrix sparse;
    if (!problem.Evaluate(options, nullptr, &residuals, nullptr, &sparse))
      return Fail("the fit of the blur cannot be evaluated at its end");
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(sparse.num_rows, sparse.num_cols);
    for (int row = 0; row < sparse.num_rows; ++row) {
      for (int k = sparse.rows[static_cast<std::size_t>(row)];
           k < sparse.rows[static_cast<std::size_t>(row) + 1]; ++k)
        jacobian(row, sparse.cols[static_cast<std::size_t>(k)]) =
            sparse.values[static_cast<std::size_t>(k)];
    }
    return FromJacobian(jacobian, residuals);
  }

  bool FromJacobian(const Eigen::MatrixXd& jacobian, const std::vector<double>& residuals) {
    std::vector<int> free = {kFocusDepth, kBlurRatio};
    if (!FloorIsHeld()) free.push_back(kFloorVariance);
    // What loses all weight is no datum: the weights' sum counts.
    double lost = 0;
    for (const Eigen::VectorXd& weights : meter_weights_) lost += (1 - weights.array()).sum();
    lost += (1 - prior_weights_.array()).sum() + (1 - scale_weights_.array()).sum();
    double chi2 = 0;
    for (const double r : residuals) chi2 += r * r;
    const double freedom =
        static_cast<double>(jacobian.rows()) - static_cast<double>(jacobian.cols()) - lost;
    if (!(freedom > 0.5)) return Fail("too few frames fit the blur law to tell its errors");
    result_.chi2_per_dof = chi2 / freedom;

    // In units of the parameters' own size, singular values tell what the data leave free.
    const Eigen::VectorXd norms = jacobian.colwise().norm().cwiseMax(1e-300);
    const Eigen::MatrixXd scaled = jacobian * norms.cwiseInverse().asDiagonal();
    const Eigen::BDCSVD<Eigen::MatrixXd> svd(scaled, Eigen::ComputeThinV);
    const Eigen::VectorXd& singular = svd.singularValues();
    if (!(singular.tail<1>()[0] > 1e-7 * singular[0])) {
      NameWeak(free, svd.matrixV().rightCols<1>());
      return Fail("the data do not tell apart: " + result_.weak_direction);
    }
    const Eigen::MatrixXd half =
        norms.cwiseInverse().asDiagonal() * svd.matrixV() * singular.cwiseInverse().asDiagonal();
    const bool widen =
        !setup_.reading_sigma_is_known || result_.chi2_per_dof > LargestByChance(freedom);
    result_.error_factor = widen ? std::sqrt(std::max(result_.chi2_per_dof, 1e-4)) : 1;
    const double factor = result_.error_factor * result_.error_factor;

    result_.values = parameters_.global;
    for (std::size_t a = 0; a < free.size(); ++a) {
      for (std::size_t b = 0; b < free.size(); ++b) {
        result_.covariance(free[a], free[b]) =
            factor *
            half.row(static_cast<Eigen::Index>(a)).dot(half.row(static_cast<Eigen::Index>(b)));
      }
    }
    NameWorst(free);
    result_.softness_px2 = parameters_.softness;
    const auto n = static_cast<Eigen::Index>(setup_.frames.size());
    result_.reading_error_sigmas_mm = Eigen::VectorXd::Zero(n);
    if (!ReadingsAreExact()) {
      Eigen::Index column = static_cast<Eigen::Index>(free.size());
      for (const BlurSamples& meter : setup_.meters) column += meter.held_softness_px2 ? 0 : 1;
      for (Eigen::Index i = 0; i < n; ++i)
        result_.reading_error_sigmas_mm[i] = std::sqrt(factor) * half.row(column + i).norm();
    }
    return true;
  }

  void NameWeak(const std::vector<int>& free, const Eigen::VectorXd& direction) {
    for (std::size_t i = 0; i < free.size(); ++i) {
      if (std::abs(direction[static_cast<Eigen::Index>(i)]) < 0.2) continue;
      result_.weak_direction += (result_.weak_direction.empty() ? "" : " with ") +
                                std::string(kNames[static_cast<std::size_t>(free[i])]);
    }
    if (result_.weak_direction.empty()) result_.weak_direction = "the nuisance of the target";
  }

  // The longest axis of the correlation matrix: what is known worst once units are taken out.
  void NameWorst(const std::vector<int>& free) {
    const auto n = static_cast<Eigen::Index>(free.size());
    Eigen::MatrixXd correlation(n, n);
    for (Eigen::Index a = 0; a < n; ++a) {
      for (Eigen::Index b = 0; b < n; ++b) {
        const int i = free[static_cast<std::size_t>(a)], j = free[static_cast<std::size_t>(b)];
        correlation(a, b) = result_.covariance(i, j) /
                            std::sqrt(result_.covariance(i, i) * result_.covariance(j, j));
      }
    }
    Eigen::Index a = 0, b = 1;
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = i + 1; j < n; ++j) {
        if (std::abs(correlation(i, j)) > std::abs(correlation(a, b))) {
          a = i;
          b = j;
        }
      }
    }
    result_.weak_direction = fmt::format(
        "{} with {} (correlation {:+.2f})",
        kNames[static_cast<std::size_t>(free[static_cast<std::size_t>(a)])],
        kNames[static_cast<std::size_t>(free[static_cast<std::size_t>(b)])], correlation(a, b));
  }

  // Residuals with the readings as written, against the errors of meter and reading together.
  void FillFrames() {
    const auto n = static_cast<Eigen::Index>(setup_.frames.size());
    result_.reading_errors_mm = parameters_.errors_mm;
    result_.residuals = Eigen::VectorXd::Zero(n);
    result_.weights = prior_weights_.cwiseMin(scale_weights_);
    for (std::size_t m = 0; m < setup_.meters.size(); ++m) {
      const BlurSamples& meter = setup_.meters[m];
      for (std::size_t i = 0; i < meter.frames.size(); ++i) {
        const std::size_t f = meter.frames[i];
        const auto row = static_cast<Eigen::Index>(f);
        const double as_written_mm =
            parameters_.global[kBenchOffset] + bench_.sign * setup_.frames[f].reading_mm;
        const Prediction p =
            Predict(setup_, parameters_.global, as_written_mm, setup_.frames[f].scale);
        const auto k = static_cast<Eigen::Index>(i);
        const double sigma =
            std::hypot(std::sqrt(meter.covariance(k, k)), p.by_depth * setup_.reading_sigma_mm);
        const double rest = meter.variances_px2[k] - parameters_.softness[m] - p.value;
        const double standardised = rest / std::max(sigma, 1e-9);
        if (std::abs(standardised) > std::abs(result_.residuals[row]))
          result_.residuals[row] = standardised;
        result_.weights[row] = std::min(result_.weights[row], meter_weights_[m][k]);
      }
    }
  }

  const BlurFitSetup& setup_;
  Bench bench_;
  Parameters parameters_;
  std::vector<std::size_t> scale_frames_;
  std::vector<Eigen::VectorXd> meter_weights_;
  Eigen::VectorXd prior_weights_, scale_weights_;
  BlurFitResult result_;
};

}  // namespace

double DefocusVariance(const BlurFitSetup& setup, double focus_depth_mm, double depth_mm) {
  const double f1 = setup.lens.front_focal_length_mm;
  const double k_mm = f1 * focus_depth_mm / (focus_depth_mm - f1);
  const double defocus = setup.law == BlurLaw::kPerspective
                             ? 1 / depth_mm - 1 / focus_depth_mm
                             : (depth_mm - focus_depth_mm) / (focus_depth_mm * focus_depth_mm);
  const double radius_px = setup.lens.aperture_radius_mm * k_mm * defocus / setup.pixel_pitch_mm;
  return radius_px * radius_px;
}

BlurFitResult FitBlur(const BlurFitSetup& setup, const BlurFitResult* start) {
  if (setup.frames.empty()) {
    BlurFitResult none;
    none.message = "no frame is left to fit";
    return none;
  }
  BlurFitResult result = Fit(setup).Run(start);
  const double offset_sigma_mm = setup.offset_mm.sigma;
  if (!result.done || !(offset_sigma_mm > 0)) return result;
  // How the answer moves with the bench zero, by central differences over its own uncertainty.
  BlurFitSetup moved = setup;
  moved.offset_mm.value = setup.offset_mm.value + offset_sigma_mm;
  const BlurFitResult above = Fit(moved).Run(&result);
  moved.offset_mm.value = setup.offset_mm.value - offset_sigma_mm;
  const BlurFitResult below = Fit(moved).Run(&result);
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
