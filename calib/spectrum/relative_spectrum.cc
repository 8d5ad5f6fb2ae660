#include "calib/spectrum/relative_spectrum.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "calib/spectrum/spectral_transfer.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/pi.h"

namespace thicklens::calib {
namespace {

constexpr double kTwoPiSquared = 2 * kPi * kPi;
constexpr Eigen::Index kMisfitRings = 8;
constexpr int kMaxSteps = 30;
// Limit of 2 pi^2 (V of the reference - V) nu^2 along an axis where a frame is sharper than the
// reference. Up to it, the leakage along that axis is e^2 times the measured one at most. Without a
// limit, the noise of the reference moved frames between the foci of an astigmatic lens by 19
// standard deviations.
constexpr double kSharperBand = 2;

// The leakage for one variance in all directions, or for one along each axis.
template <int kAxes>
using LeakageOf = std::conditional_t<kAxes == 1, WindowLeakage, AxisLeakage>;

// Gauss-Newton with T projected out. Amplitudes (ln g, V) and shifts do not mix in the normal
// equations: the derivatives by the amplitudes are real multiples of the model, and those by the
// shifts are imaginary. A frame has one V in all directions, or one along each of two axes.
template <int kAxes>
class Fit {
 public:
  Fit(const std::vector<SpectrumSample>& samples, std::size_t reference, const TargetWindow& window,
      const std::vector<Mode>& modes, const LeakageOf<kAxes>& leakage,
      const RelativeBlurOptions& options)
      : samples_(samples), reference_(reference), leakage_(leakage), options_(options) {
    const auto n = static_cast<Eigen::Index>(samples.size());
    const auto count = static_cast<Eigen::Index>(modes.size());
    nu_.resize(2, count);
    for (Eigen::Index k = 0; k < count; ++k)
      nu_.col(k) = ModeFrequency(modes[static_cast<std::size_t>(k)], window);
    norm2_ = nu_.colwise().squaredNorm().transpose().array();
    along_ = Eigen::Rotation2Dd(-options.axis_angle_rad).toRotationMatrix() * nu_;
    if constexpr (kAxes == 1) {
      shares_.setOnes(1, count);
    } else {
      shares_ = along_.array().square().rowwise() / norm2_.transpose();
    }
    box2_.resize(samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const auto c = samples[i].spectrum.values.size();
      box2_[i].resize(c);
      for (Eigen::Index k = 0; k < c; ++k) {
        const double box =
            BoxTransfer(modes[static_cast<std::size_t>(k)], window, samples[i].scale);
        box2_[i][k] = box * box;
      }
    }
    state_.log_gain = Eigen::VectorXd::Zero(n);
    state_.variance.resize(kAxes, n);
    state_.shift = Eigen::Matrix2Xd::Zero(2, n);
    noise_.resize(n);
    expected_noise_.resize(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const SpectrumSample& sample = samples[static_cast<std::size_t>(i)];
      state_.variance.col(i) = StartOf(sample);
      expected_noise_[i] =
          std::max(sample.spectrum.noise_gain * sample.pixel_noise * sample.pixel_noise, 1e-14);
    }
    noise_ = expected_noise_;
  }

  // `done` and `message` of the result are set; the rest only where it is done.
  RelativeBlur Run() {
    if (samples_.size() < 3) {
      result_.message = fmt::format("spectra were measured on {} frames, but at least 3 are needed",
                                    samples_.size());
      return result_;
    }
    // The band, the leakage and the noise depend on the fitted blur; three rounds are enough to
    // converge.
    for (int round = 0; round < 3; ++round) {
      ChooseBands();
      TakeLeakageOut();
      if (!Descend()) return result_;
      EstimateNoise();
    }
    if (!Finish()) return result_;
    result_.done = true;
    result_.message = "converged";
    return result_;
  }

 private:
  static constexpr int kAmplitudes = 1 + kAxes;  // ln g and V, per frame
  using Variance = Eigen::Matrix<double, kAxes, 1>;
  using Variances = Eigen::Matrix<double, kAxes, Eigen::Dynamic>;
  using Amplitudes = Eigen::Matrix<double, kAmplitudes, Eigen::Dynamic>;

  struct State {
    Eigen::VectorXd log_gain;
    Variances variance;
    Eigen::Matrix2Xd shift;
  };

  static Variance StartOf(const SpectrumSample& sample) {
    if constexpr (kAxes == 1) {
      return Variance(sample.start_variance_px2);
    } else {
      return sample.start_variances_px2.value_or(
          Eigen::Vector2d::Constant(sample.start_variance_px2));
    }
  }

  // V along the direction of a mode: of two axes, V_x cos^2 + V_y sin^2.
  double VarianceAt(const Variances& variance, Eigen::Index i, Eigen::Index k) const {
    if constexpr (kAxes == 1) {
      return variance(0, i);
    } else {
      return variance.col(i).dot(shares_.col(k).matrix());
    }
  }

  Eigen::Index n() const { return static_cast<Eigen::Index>(samples_.size()); }
  // Number of leading modes that a frame is modelled at, and how many of them are in its band.
  Eigen::Index Count(Eigen::Index i) const { return counts_[static_cast<std::size_t>(i)]; }
  Eigen::Index Used(Eigen::Index i) const { return used_[static_cast<std::size_t>(i)]; }

  // Chooses the modes of every frame. `weight_` is 0 where a mode is beyond the band, and the box's
  // square elsewhere. With one V the band ends at a frequency; with two its end depends on the
  // direction, and so does the frame that is the sharpest.
  void ChooseBands() {
    counts_.assign(samples_.size(), 0);
    used_.assign(samples_.size(), 0);
    weight_ = box2_;
    const Eigen::Index all = norm2_.size();
    Eigen::ArrayXd least = Eigen::ArrayXd::Constant(all, std::numeric_limits<double>::infinity());
    for (Eigen::Index k = 0; k < all; ++k) {
      for (Eigen::Index i = 0; i < n(); ++i)
        least[k] = std::min(least[k], VarianceAt(state_.variance, i, k));
    }
    for (Eigen::Index i = 0; i < n(); ++i) {
      const auto s = static_cast<std::size_t>(i);
      for (Eigen::Index k = 0; k < weight_[s].size(); ++k) {
        const double range = std::max(VarianceAt(state_.variance, i, k) - least[k], 1e-9);
        if (norm2_[k] < options_.band / (kTwoPiSquared * range) && LeakageIsKnown(i, k)) {
          counts_[s] = k + 1;
          ++used_[s];
        } else {
          weight_[s][k] = 0;
        }
      }
    }
    modes_ = *std::max_element(counts_.begin(), counts_.end());
  }

  // The window's leakage is measured on the reference. In a frame that is sharper along one axis it
  // is larger by the transfer function of the difference, with the noise of the reference.
  bool LeakageIsKnown(Eigen::Index i, Eigen::Index k) const {
    if constexpr (kAxes == 1) {
      return true;
    } else {
      const Variance sharper =
          state_.variance.col(static_cast<Eigen::Index>(reference_)) - state_.variance.col(i);
      return kTwoPiSquared * (sharper.array() * along_.col(k).array().square()).maxCoeff() <
             kSharperBand;
    }
  }

  // The reference of an astigmatic lens is not the sharpest frame along either axis. The leakage is
  // proportional to V for a small blur, so that its sign changes where a frame is sharper.
  static Eigen::ArrayXcd SignedLeakage(const WindowLeakage& leakage, double added_px2,
                                       std::size_t count) {
    if (added_px2 >= 0) return leakage.At(added_px2, count);
    return -leakage.At(-added_px2, count);
  }

  // The window's leakage at the modes of a frame.
  Eigen::ArrayXcd LeakageOfFrame(Eigen::Index i) const {
    const Variance added =
        state_.variance.col(i) - state_.variance.col(static_cast<Eigen::Index>(reference_));
    const auto count = static_cast<std::size_t>(Count(i));
    if constexpr (kAxes == 1) {
      return leakage_.At(added[0], count);
    } else {
      // B_y B_x seen through the window: the leakage of one axis is blurred along the other.
      Eigen::ArrayXcd leaked = Eigen::ArrayXcd::Zero(Count(i));
      const Eigen::ArrayXcd along[] = {SignedLeakage(leakage_.x, added[0], count),
                                       SignedLeakage(leakage_.y, added[1], count)};
      for (Eigen::Index k = 0; k < leaked.size(); ++k) {
        for (const int axis : {0, 1}) {
          const double other =
              SpectralTransfer(options_.psf, 0, added[1 - axis], 1, std::abs(along_(1 - axis, k)))
                  .value;
          leaked[k] += other * along[axis][k];
        }
      }
      return leaked;
    }
  }

  void TakeLeakageOut() {
    data_.resize(samples_.size());
    for (Eigen::Index i = 0; i < n(); ++i) {
      const auto s = static_cast<std::size_t>(i);
      // The leakage has the frame's own gain and the remaining shift.
      Eigen::ArrayXcd leaked = LeakageOfFrame(i);
      for (Eigen::Index k = 0; k < leaked.size(); ++k) {
        leaked[k] *= std::polar(std::exp(state_.log_gain[i]),
                                -2 * kPi * nu_.col(k).dot(state_.shift.col(i)));
      }
      data_[s] = samples_[s].spectrum.values.head(Count(i)) - leaked;
    }
  }

  // M_i(k) = g_i H_i(k) exp(-2 pi i nu.t_i), and d ln M/dV with V along the mode's direction.
  void Model(const State& state, Eigen::Index i, Eigen::ArrayXcd* model,
             Eigen::ArrayXd* slope) const {
    const double scale = samples_[static_cast<std::size_t>(i)].scale;
    const double gain = std::exp(state.log_gain[i]);
    model->resize(Count(i));
    slope->resize(Count(i));
    for (Eigen::Index k = 0; k < Count(i); ++k) {
      const TransferAndSlope h =
          SpectralTransfer(options_.psf, options_.floor_variance_px2,
                           VarianceAt(state.variance, i, k), scale, std::sqrt(norm2_[k]));
      const double phase = -2 * kPi * nu_.col(k).dot(state.shift.col(i));
      (*model)[k] = std::polar(1.0, phase) * (gain * h.value);
      (*slope)[k] = h.log_slope;
    }
  }

  struct Evaluation {
    double cost = 0;
    Eigen::ArrayXcd texture;
    Eigen::ArrayXd information;  // P = sum |M|^2/N per mode
    std::vector<Eigen::ArrayXcd> models;
    std::vector<Eigen::ArrayXd> slopes;
  };

  // T by linear least squares at every mode, and the residuals.
  Evaluation Evaluate(const State& state) const {
    Evaluation e;
    e.models.resize(samples_.size());
    e.slopes.resize(samples_.size());
    e.texture = Eigen::ArrayXcd::Zero(modes_);
    e.information = Eigen::ArrayXd::Zero(modes_);
    Eigen::ArrayXd energy = Eigen::ArrayXd::Zero(modes_);
    for (Eigen::Index i = 0; i < n(); ++i) {
      const auto s = static_cast<std::size_t>(i);
      Model(state, i, &e.models[s], &e.slopes[s]);
      const Eigen::ArrayXd weight = weight_[s].head(Count(i)) / noise_[i];
      e.texture.head(Count(i)) += e.models[s].conjugate() * data_[s] * weight;
      e.information.head(Count(i)) += e.models[s].abs2() * weight;
      energy.head(Count(i)) += data_[s].abs2() * weight;
    }
    // Modes that no frame has in its band carry no weight.
    if constexpr (kAxes > 1) e.information = (e.information > 0).select(e.information, 1);
    e.cost = (energy - e.texture.abs2() / e.information).sum();
    e.texture /= e.information;
    return e;
  }

  // Gauss-Newton with a damping that grows where a step fails.
  bool Descend() {
    Evaluation now = Evaluate(state_);
    double damping = 1e-6;
    for (int step = 0; step < kMaxSteps; ++step) {
      ThrowIfCancelled();
      Eigen::VectorXd gradient;
      const Eigen::MatrixXd normal = AmplitudeNormal(now, &gradient);
      const Eigen::Matrix2Xd shifts = ShiftSteps(now);
      bool better = false;
      for (int attempt = 0; attempt < 8 && !better; ++attempt) {
        ThrowIfCancelled();
        const State next = Moved(Solved(normal, gradient, damping), shifts / (1 + damping));
        Evaluation there = Evaluate(next);
        if (std::isfinite(there.cost) && there.cost <= now.cost) {
          const double gained = now.cost - there.cost;
          state_ = next;
          now = std::move(there);
          damping = std::max(1e-9, 0.1 * damping);
          better = true;
          if (gained < 1e-7 * now.cost + 1e-9) step = kMaxSteps;
        } else {
          damping = std::max(1e-4, 30 * damping);
        }
      }
      if (!better) break;
    }
    last_ = std::move(now);
    if (!std::isfinite(last_.cost) || !state_.variance.allFinite()) {
      result_.message = "the fit of the spectra did not converge";
      return false;
    }
    return true;
  }

  // Solves the equations without the reference's rows: its gain and variance are held, because they
  // would only change T.
  static Eigen::VectorXd Solved(const Eigen::MatrixXd& normal, const Eigen::VectorXd& gradient,
                                double damping) {
    Eigen::MatrixXd damped = normal;
    damped.diagonal() *= 1 + damping;
    damped.diagonal().array() += 1e-12 * normal.diagonal().maxCoeff();
    const Eigen::VectorXd diagonal = damped.diagonal();
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(damped);  // in place
    if (factor.info() == Eigen::Success) return factor.solve(gradient);
    damped = normal;
    damped.diagonal() = diagonal;
    return damped.ldlt().solve(gradient);  // indefinite by rounding alone
  }

  State Moved(const Eigen::VectorXd& amplitude, const Eigen::Matrix2Xd& shifts) const {
    State next = state_;
    next.shift += shifts;
    Eigen::Index row = 0;
    for (Eigen::Index i = 0; i < n(); ++i) {
      if (i == static_cast<Eigen::Index>(reference_)) continue;
      next.log_gain[i] += std::clamp(amplitude[kAmplitudes * row], -0.3, 0.3);
      next.variance.col(i) += amplitude.template segment<kAxes>(kAmplitudes * row + 1);
      ++row;
    }
    return next;
  }

  // Normal matrix of (ln g, V) of every frame: sum over modes of |T|^2 |M|^2/N d d^T within a
  // frame, minus the projection on T. Only the lower triangle is filled.
  Eigen::MatrixXd AmplitudeNormal(const Evaluation& e, Eigen::VectorXd* gradient) const {
    const Eigen::Index size = kAmplitudes * (n() - 1);
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(size, size);
    Eigen::MatrixXd projection = Eigen::MatrixXd::Zero(size, modes_);
    gradient->resize(size);
    const Eigen::ArrayXd power = e.texture.abs2();
    const Eigen::ArrayXd root = (power / e.information).sqrt();
    Eigen::Index row = 0;
    for (Eigen::Index i = 0; i < n(); ++i) {
      if (i == static_cast<Eigen::Index>(reference_)) continue;
      const auto s = static_cast<std::size_t>(i);
      const Eigen::Index c = Count(i);
      Amplitudes d(kAmplitudes, c);
      d.row(0).setConstant(options_.hold_gains ? 0 : 1);  // without a derivative it does not move
      for (int axis = 0; axis < kAxes; ++axis) {
        d.row(1 + axis) =
            (e.slopes[s] * shares_.row(axis).head(c).transpose().array()).matrix().transpose();
      }
      const Eigen::ArrayXcd model = e.models[s] * e.texture.head(c);
      const Eigen::ArrayXd noise = weight_[s].head(c) / noise_[i];
      const Eigen::ArrayXd pull = (model.conjugate() * (data_[s] - model)).real() * noise;
      gradient->template segment<kAmplitudes>(kAmplitudes * row) = d * pull.matrix();
      const Eigen::ArrayXd weight = e.models[s].abs2() * noise;
      const Amplitudes weighted = d.array().rowwise() * (weight * power.head(c)).transpose();
      normal.template block<kAmplitudes, kAmplitudes>(kAmplitudes * row, kAmplitudes * row) =
          weighted * d.transpose();
      projection.block(kAmplitudes * row, 0, kAmplitudes, c) =
          d.array().rowwise() * (weight * root.head(c)).transpose();
      ++row;
    }
    normal.selfadjointView<Eigen::Lower>().rankUpdate(projection, -1);
    return normal;
  }

  // d M/dt = -2 pi i nu M. The shifts of the frames are coupled only weakly through T. A separate
  // step for each frame therefore converges as well, and their covariance is not needed.
  Eigen::Matrix2Xd ShiftSteps(const Evaluation& e) const {
    Eigen::Matrix2Xd steps = Eigen::Matrix2Xd::Zero(2, n());
    for (Eigen::Index i = 0; i < n(); ++i) {
      const auto s = static_cast<std::size_t>(i);
      const Eigen::Index c = Count(i);
      if (c < 3) continue;
      const Eigen::ArrayXcd model = e.models[s] * e.texture.head(c);
      const Eigen::ArrayXd weight = weight_[s].head(c) / noise_[i];
      const Eigen::ArrayXd pull = (model.conjugate() * (data_[s] - model)).imag() * weight;
      const Eigen::Matrix2Xd d = -2 * kPi * nu_.leftCols(c);
      const Eigen::Matrix2Xd weighted = d.array().rowwise() * (model.abs2() * weight).transpose();
      const Eigen::Matrix2d normal = weighted * d.transpose();
      // A shift along a single edge has no effect. The decomposition keeps that direction
      // unchanged.
      steps.col(i) = normal.completeOrthogonalDecomposition().solve(d * pull.matrix());
    }
    return steps;
  }

  // The noise follows from the residuals, each with its frame's own degrees of freedom. A lower
  // limit applies, relative to the pixel noise and the other frames, because a frame that alone
  // contains a mode fits itself.
  void EstimateNoise() {
    Eigen::VectorXd found(n());
    std::vector<double> ratios;
    for (Eigen::Index i = 0; i < n(); ++i) {
      const auto s = static_cast<std::size_t>(i);
      const Eigen::Index c = Count(i);
      const Eigen::ArrayXd weight = weight_[s].head(c) / noise_[i];
      const Eigen::ArrayXd leverage = last_.models[s].abs2() * weight / last_.information.head(c);
      const double freedom = std::max(
          1.0, static_cast<double>(Used(i)) - leverage.sum() - kAmplitudes * (n() > 1 ? 1 : 0));
      const Eigen::ArrayXcd rest = data_[s] - last_.models[s] * last_.texture.head(c);
      found[i] = (rest.abs2() * weight_[s].head(c)).sum() / freedom;
      ratios.push_back(found[i] / expected_noise_[i]);
    }
    std::vector<double> sorted = ratios;
    std::nth_element(sorted.begin(), sorted.begin() + n() / 2, sorted.end());
    const double typical = sorted[static_cast<std::size_t>(n() / 2)];
    for (Eigen::Index i = 0; i < n(); ++i)
      noise_[i] = std::max(found[i], 0.5 * typical * expected_noise_[i]);
  }

  // The tails by one Gauss-Newton step, with gains, variances and T eliminated. d ln M/d tails = 4
  // u^2 is real, as the derivatives by the amplitudes are. `solve` applies the inverse of their
  // normal matrix.
  template <typename Solve>
  void FillTails(const Evaluation& e, const Eigen::VectorXd& gradient, const Solve& solve) {
    const Eigen::ArrayXd power = e.texture.abs2();
    const Eigen::ArrayXd root = (power / e.information).sqrt();
    std::vector<Eigen::ArrayXd> slopes(samples_.size()), weights(samples_.size());
    Eigen::VectorXd projected = Eigen::VectorXd::Zero(modes_);
    double own = 0, pull = 0;
    for (Eigen::Index i = 0; i < n(); ++i) {
      const auto s = static_cast<std::size_t>(i);
      const Eigen::Index c = Count(i);
      const double defocus_px2 =
          state_.variance(0, i) - options_.floor_variance_px2 / std::pow(samples_[s].scale, 2);
      slopes[s] = 4 * (kTwoPiSquared * defocus_px2 * norm2_.head(c)).square();
      const Eigen::ArrayXd noise = weight_[s].head(c) / noise_[i];
      weights[s] = e.models[s].abs2() * noise;
      projected.head(c) += (weights[s] * root.head(c) * slopes[s]).matrix();
      own += (weights[s] * power.head(c) * slopes[s].square()).sum();
      const Eigen::ArrayXcd model = e.models[s] * e.texture.head(c);
      pull += ((model.conjugate() * (data_[s] - model)).real() * noise * slopes[s]).sum();
    }
    Eigen::VectorXd mixed(kAmplitudes * (n() - 1));
    Eigen::Index row = 0;
    for (Eigen::Index i = 0; i < n(); ++i) {
      if (i == static_cast<Eigen::Index>(reference_)) continue;
      const auto s = static_cast<std::size_t>(i);
      const Eigen::Index c = Count(i);
      const Eigen::ArrayXd shared =
          weights[s] * (power.head(c) * slopes[s] - root.head(c) * projected.head(c).array());
      mixed[kAmplitudes * row] = shared.sum();
      mixed[kAmplitudes * row + 1] = (shared * e.slopes[s]).sum();
      ++row;
    }
    const Eigen::VectorXd answer = solve(mixed);
    const double information = own - projected.squaredNorm() - mixed.dot(answer);
    result_.variance_by_tails = Eigen::VectorXd::Zero(n());
    row = 0;
    for (Eigen::Index i = 0; i < n(); ++i) {
      if (i == static_cast<Eigen::Index>(reference_)) continue;
      result_.variance_by_tails[i] = -answer[kAmplitudes * row + 1];
      ++row;
    }
    // Without defocus, or at one blur alone, the data do not determine the shape.
    if (!(information > 1e-12 * own)) {
      result_.tails = {0, std::numeric_limits<double>::infinity()};
      return;
    }
    result_.tails = {(pull - answer.dot(gradient)) / information,
                     std::sqrt(kRealPart * kSharedNoise / information)};
  }

  bool Finish() {
    const Eigen::Index size = kAmplitudes * (n() - 1);
    Eigen::VectorXd gradient;
    Eigen::MatrixXd normal = AmplitudeNormal(Evaluate(state_), &gradient);
    const Eigen::VectorXd scale = normal.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
    // The gains come first. The remaining factor, that of the variances, is then the factor of
    // their own normal matrix with the gains eliminated.
    std::vector<Eigen::Index> order;
    for (Eigen::Index k = 0; k < size; k += kAmplitudes) order.push_back(k);
    for (Eigen::Index k = 0; k < size; ++k) {
      if (k % kAmplitudes != 0) order.push_back(k);
    }
    Eigen::MatrixXd scaled(size, size);  // its lower triangle
    for (Eigen::Index b = 0; b < size; ++b) {
      for (Eigen::Index a = b; a < size; ++a) {
        const auto [low, high] =
            std::minmax(order[static_cast<std::size_t>(a)], order[static_cast<std::size_t>(b)]);
        scaled(a, b) = scale[low] * scale[high] * normal(high, low);
      }
    }
    const Eigen::VectorXd full_scale = scale;
    normal.resize(0, 0);  // these matrices need most of the memory of a long sweep
    scaled.diagonal().array() += 1e-12;
    const Eigen::LLT<Eigen::Ref<Eigen::MatrixXd>> factor(scaled);  // in place
    if (factor.info() != Eigen::Success) {
      result_.message = "the spectra do not determine the blur of every frame";
      return false;
    }
    if constexpr (kAxes == 1) {
      FillTails(Evaluate(state_), gradient, [&](const Eigen::VectorXd& of) -> Eigen::VectorXd {
        Eigen::VectorXd permuted(size), solved(size);
        for (Eigen::Index a = 0; a < size; ++a) {
          const Eigen::Index at = order[static_cast<std::size_t>(a)];
          permuted[a] = full_scale[at] * of[at];
        }
        permuted = factor.solve(permuted);
        for (Eigen::Index a = 0; a < size; ++a) {
          const Eigen::Index at = order[static_cast<std::size_t>(a)];
          solved[at] = full_scale[at] * permuted[a];
        }
        return solved;
      });
    }
    const Eigen::Index variances = kAxes * (n() - 1);
    Eigen::MatrixXd inverse_root = Eigen::MatrixXd::Identity(variances, variances);
    scaled.bottomRightCorner(variances, variances)
        .template triangularView<Eigen::Lower>()
        .solveInPlace(inverse_root);
    scaled.resize(0, 0);
    for (Eigen::Index k = 0; k < variances; ++k)
      inverse_root.col(k) *= scale[order[static_cast<std::size_t>(n() - 1 + k)]];
    const Eigen::MatrixXd inverse = inverse_root.transpose() * inverse_root;
    std::vector<Eigen::Index> rows;
    for (Eigen::Index i = 0; i < n(); ++i) {
      for (Eigen::Index axis = 0; axis < kAxes; ++axis) {
        if (i != static_cast<Eigen::Index>(reference_)) rows.push_back(kAxes * i + axis);
      }
    }
    result_.covariance = Eigen::MatrixXd::Zero(kAxes * n(), kAxes * n());
    for (std::size_t a = 0; a < rows.size(); ++a) {
      for (std::size_t b = 0; b < rows.size(); ++b) {
        result_.covariance(rows[a], rows[b]) =
            kRealPart * kSharedNoise *
            inverse(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
      }
    }
    result_.variances_px2 = state_.variance.reshaped();
    result_.gains = state_.log_gain.array().exp();
    result_.shifts_px = state_.shift;
    result_.noise_ratio = noise_.cwiseQuotient(expected_noise_);
    result_.modes_used.assign(used_.begin(), used_.end());
    result_.texture = last_.texture;
    FillMisfit();
    return true;
  }

  void FillMisfit() {
    Eigen::Array<bool, Eigen::Dynamic, 1> seen =
        Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(modes_, false);
    for (Eigen::Index i = 0; i < n(); ++i)
      seen.head(Count(i)) =
          seen.head(Count(i)) || weight_[static_cast<std::size_t>(i)].head(Count(i)) > 0;
    double chi2 = 0, freedom = -static_cast<double>(seen.count()) -
                               1.0 * kAmplitudes * static_cast<double>(n() - 1);
    for (Eigen::Index i = 0; i < n(); ++i) {
      const auto s = static_cast<std::size_t>(i);
      const Eigen::ArrayXcd rest = data_[s] - last_.models[s] * last_.texture.head(Count(i));
      chi2 += (rest.abs2() * weight_[s].head(Count(i))).sum() / expected_noise_[i];
      freedom += static_cast<double>(Used(i));
    }
    result_.chi2_per_dof = freedom > 0 ? chi2 / freedom : 0;
    result_.misfit.resize(n());
    for (Eigen::Index i = 0; i < n(); ++i) result_.misfit[i] = MisfitOf(i);
  }

  // The strongest modes, which are the lowest ones, must not hide a misfit of the others: every
  // ring has its own share.
  double MisfitOf(Eigen::Index i) const {
    const auto s = static_cast<std::size_t>(i);
    const Eigen::Index count = Count(i);
    const Eigen::ArrayXd weight = weight_[s].head(count);
    const Eigen::ArrayXd rest =
        weight * (data_[s] - last_.models[s] * last_.texture.head(count)).abs2();
    const Eigen::ArrayXd all = weight * data_[s].abs2();
    double shares = 0;
    int rings = 0;
    for (Eigen::Index ring = 0; ring < kMisfitRings; ++ring) {
      const Eigen::Index first = ring * count / kMisfitRings;
      const Eigen::Index modes = (ring + 1) * count / kMisfitRings - first;
      const double power = all.segment(first, modes).sum();
      if (!(power > 0)) continue;
      shares += rest.segment(first, modes).sum() / power;
      ++rings;
    }
    return rings > 0 ? shares / rings : 0;
  }

  const std::vector<SpectrumSample>& samples_;
  std::size_t reference_;
  const LeakageOf<kAxes>& leakage_;
  RelativeBlurOptions options_;
  Eigen::Matrix2Xd nu_, along_;  // frequencies along x and y, and along the axes of the blur
  Eigen::ArrayXd norm2_;
  // Share of each axis in |nu|^2, per mode; 1 where there is one V.
  Eigen::Array<double, kAxes, Eigen::Dynamic> shares_;
  std::vector<Eigen::ArrayXd> box2_, weight_;
  std::vector<Eigen::Index> counts_, used_;
  Eigen::Index modes_ = 0;
  std::vector<Eigen::ArrayXcd> data_;  // spectra without the window's leakage
  State state_;
  Eigen::VectorXd noise_, expected_noise_;
  Evaluation last_;
  RelativeBlur result_;
};
}  // namespace

RelativeBlur FitRelativeBlur(const std::vector<SpectrumSample>& samples, std::size_t reference,
                             const TargetWindow& window, const std::vector<Mode>& modes,
                             const WindowLeakage& leakage, const RelativeBlurOptions& options) {
  return Fit<1>(samples, reference, window, modes, leakage, options).Run();
}

AxialBlur FitAxialBlur(const std::vector<SpectrumSample>& samples, std::size_t reference,
                       const TargetWindow& window, const std::vector<Mode>& modes,
                       const AxisLeakage& leakage, const RelativeBlurOptions& options) {
  RelativeBlur fit = Fit<2>(samples, reference, window, modes, leakage, options).Run();
  AxialBlur blur;
  blur.done = fit.done;
  blur.message = fit.message;
  if (!fit.done) return blur;
  blur.variances_px2 = fit.variances_px2.reshaped(2, fit.variances_px2.size() / 2);
  blur.covariance = std::move(fit.covariance);
  blur.gains = fit.gains;
  blur.shifts_px = fit.shifts_px;
  blur.noise_ratio = fit.noise_ratio;
  blur.misfit = fit.misfit;
  blur.modes_used = fit.modes_used;
  blur.chi2_per_dof = fit.chi2_per_dof;
  blur.texture = std::move(fit.texture);
  return blur;
}

RelativeBlur MeanOfAxes(const AxialBlur& axial) {
  RelativeBlur mean;
  mean.done = axial.done;
  mean.message = axial.message;
  mean.tails.sigma = std::numeric_limits<double>::infinity();
  if (!axial.done) return mean;
  mean.variances_px2 = axial.variances_px2.colwise().mean().transpose();
  const Eigen::Index n = axial.variances_px2.cols();
  const auto x = Eigen::seqN(0, n, 2), y = Eigen::seqN(1, n, 2);
  mean.covariance = 0.25 * (axial.covariance(x, x) + axial.covariance(x, y) +
                            axial.covariance(y, x) + axial.covariance(y, y));
  mean.gains = axial.gains;
  mean.shifts_px = axial.shifts_px;
  mean.noise_ratio = axial.noise_ratio;
  mean.misfit = axial.misfit;
  mean.modes_used = axial.modes_used;
  mean.chi2_per_dof = axial.chi2_per_dof;
  mean.texture = axial.texture;
  return mean;
}

double BlurTransfer(const RelativeBlurOptions& options, double variance_px2, double scale,
                    double nu) {
  return SpectralTransfer(options.psf, options.floor_variance_px2, variance_px2, scale, nu).value;
}

}  // namespace thicklens::calib
