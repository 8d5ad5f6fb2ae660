#include "calib/registration/stage_comparison.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>

#include "calib/sweep/frame_selection.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/pi.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinSamples = 12;
constexpr Eigen::Index kMinOnEachSide = 4;
constexpr double kFreedom = 3;            // degrees of freedom of Student's distribution
constexpr int kRounds = 8;                // of reweighting
constexpr int kMaxErrors = 3;             // kinds of errors that are found one after the other
constexpr int kMaxPlaces = 80;            // of a jump that are tried in the first pass
constexpr double kPeriodsOfSweep = 3;     // a longer period is a bend
constexpr double kShortestPeriod = 2.05;  // median steps; a shorter one looks like a longer one
constexpr double kMaxRuns = 4;            // of a sweep, for its step
constexpr double kMinBeyondLaw = 0.3;     // of waves
constexpr double kPeriodsPerPeak = 6;     // of the scan
// Part of V's range by which a parabola describes the blur of a real lens.
constexpr double kModelError = 0.002;
constexpr double kSameCorrection = 0.4;                // relative difference of two corrections
constexpr double kIsolatedFlips = 0.1, kFewFlips = 4;  // share and number of the frames
constexpr double kLargestScatter = 0.1;  // of half the range; above it there is no law
constexpr double kAmplitudeReach = 2;    // standard deviations

enum class Kind { kBacklash, kSlip, kJump, kPeriodic, kBend };

struct Cause {
  Kind kind = Kind::kBacklash;
  double place = 0;            // frame (kSlip), reading (kJump) or period (kPeriodic)
  Eigen::MatrixXd errors;      // columns: error of each sample's reading per unit amplitude
  double choices = 1;          // number of places or periods that were tried
  double scatter_mm = 0;       // of the single readings that is left
  double cost = 0;             // -2 ln(likelihood) plus that of the parameters
  Eigen::VectorXd amplitudes;  // of the columns
  Eigen::MatrixXd covariance;  // of the amplitudes
};

struct Solved {
  double minus_two_log = std::numeric_limits<double>::infinity();
  double scatter_mm = 0;
  Eigen::VectorXd values;
  Eigen::MatrixXd covariance;
};

// Least squares with Student's errors, whose scale is hypot(sigma, gain scatter), by reweighting.
Solved SolveAt(const Eigen::MatrixXd& columns, const Eigen::VectorXd& values,
               const Eigen::ArrayXd& variances) {
  const Eigen::Index n = values.size();
  Eigen::ArrayXd weights = Eigen::ArrayXd::Ones(n);
  Solved solved;
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::ArrayXd roots = (weights / variances).sqrt();
    const Eigen::MatrixXd scaled = roots.matrix().asDiagonal() * columns;
    const Eigen::VectorXd right = (roots * values.array()).matrix();
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> solver(scaled);
    solved.values = solver.solve(right);
    const Eigen::ArrayXd u2 = (values - columns * solved.values).array().square() / variances;
    weights = (kFreedom + 1) / (kFreedom + u2);
    if (round + 1 < kRounds) continue;
    solved.minus_two_log = ((kFreedom + 1) * (1 + u2 / kFreedom).log() + variances.log()).sum();
    const Eigen::MatrixXd inverse = solver.pseudoInverse();
    solved.covariance = (kFreedom + 3) / (kFreedom + 1) * (inverse * inverse.transpose());
  }
  return solved;
}

class Comparison {
 public:
  Comparison(const ReadingEvidence& evidence, const FocusSweep& sweep)
      : sweep_(sweep), evidence_(evidence), n_(evidence.values.size()) {
    const auto frames = static_cast<Eigen::Index>(sweep.frames.size());
    error_mm_ = Eigen::VectorXd::Zero(frames);
    of_sweep_.resize(frames);
    for (Eigen::Index f = 0; f < frames; ++f)
      of_sweep_[f] = sweep.frames[static_cast<std::size_t>(f)].reading_mm;
    falling_ = ApproachedFalling(of_sweep_);
    readings_.resize(n_);
    for (Eigen::Index i = 0; i < n_; ++i) readings_[i] = of_sweep_[FrameOf(i)];
    lowest_mm_ = n_ > 0 ? readings_.minCoeff() : 0;
    half_mm_ = n_ > 0 ? 0.5 * (readings_.maxCoeff() - lowest_mm_) : 0;
  }

  StageComparison Run() {
    StageComparison result;
    result.error_mm = error_mm_;
    StageErrors& errors = result.errors;
    if (evidence_.frames.size() < kMinSamples || !(half_mm_ > 0)) {
      errors.message = fmt::format("{} frames show the readings' errors, but {} are needed",
                                   evidence_.frames.size(), kMinSamples);
      return result;
    }
    Prepare();
    errors.compared = true;
    errors.message = "no systematic error of the stage was found";
    for (int round = 0; round < kMaxErrors; ++round) {
      ThrowIfCancelled();
      if (!FindNext(&result)) break;
    }
    if (!accepted_.empty()) {
      errors.message = "the readings were corrected";
      result.error_mm = error_mm_;
      Report(&result);
    }
    return result;
  }

  double ReadingErrorMm() {
    if (evidence_.frames.size() < kMinSamples || !(half_mm_ > 0))
      return std::numeric_limits<double>::infinity();
    Prepare();
    std::vector<double> errors;
    for (Eigen::Index i = 0; i < n_; ++i) {
      errors.push_back(gains_[i] != 0 ? std::sqrt(variances_[i]) / std::abs(gains_[i])
                                      : std::numeric_limits<double>::infinity());
    }
    return Median(errors);
  }

 private:
  Eigen::Index FrameOf(Eigen::Index i) const {
    return static_cast<Eigen::Index>(evidence_.frames[static_cast<std::size_t>(i)]);
  }
  bool IsFalling(Eigen::Index frame) const { return falling_[static_cast<std::size_t>(frame)]; }
  double Place(double reading_mm) const { return (reading_mm - lowest_mm_) / half_mm_ - 1; }

  // The law of the evidence at the corrected readings: columns of the law, the observed values, and
  // the derivative of the values by the error of a reading.
  void Prepare() {
    law_.resize(n_, 3);
    bend_.resize(n_, 2);
    corrected_.resize(n_);
    for (Eigen::Index i = 0; i < n_; ++i) corrected_[i] = readings_[i] - error_mm_[FrameOf(i)];
    double typical = Median({evidence_.sigmas.begin(), evidence_.sigmas.end()});
    if (evidence_.is_parabola_in_reading) {
      values_ = evidence_.values;
      const double range = values_.maxCoeff() - values_.minCoeff();
      variances_ = evidence_.sigmas.array().max(1e-3 * typical).square() +
                   std::pow(kModelError * range, 2) + 1e-30;
      for (Eigen::Index i = 0; i < n_; ++i) {
        const double u = Place(corrected_[i]);
        law_.row(i) << 1, u, u * u;
        bend_.row(i) << u * u * u, u * u * u * u;
      }
      const Eigen::VectorXd law = SolveAt(law_, values_, variances_).values;
      gains_ = -(law[1] + 2 * law[2] * (law_.col(1).array())) / half_mm_;
    } else {
      const double low = evidence_.values.minCoeff();
      const double half = std::max(0.5 * (evidence_.values.maxCoeff() - low), 1e-12);
      for (Eigen::Index i = 0; i < n_; ++i) {
        const double x = (evidence_.values[i] - low) / half - 1;
        law_.row(i) << 1, x, x * x;
        bend_.row(i) << x * x * x, x * x * x * x;
      }
      values_ = corrected_.matrix();
      gains_ = Eigen::ArrayXd::Ones(n_);
      // The slope of the readings against 1/scale converts the errors of the scales. The reference
      // has no error of its own, but those of all others are relative to it.
      const Eigen::VectorXd law = SolveAt(law_, values_, Eigen::ArrayXd::Constant(n_, 1)).values;
      const double slope = law[1] / half;
      variances_ = (slope * evidence_.sigmas.array().max(typical)).square() + 1e-18;
    }
  }

  // The change of the values by errors of the stage's readings.
  Eigen::MatrixXd ColumnsOf(const Eigen::MatrixXd& errors) const {
    return gains_.matrix().asDiagonal() * errors;
  }

  // Law, accepted causes, and `more`.
  Eigen::MatrixXd Design(const Eigen::MatrixXd& more) const {
    Eigen::Index count = law_.cols() + more.cols();
    for (const Cause& cause : accepted_) count += cause.errors.cols();
    Eigen::MatrixXd design(n_, count);
    design.leftCols(law_.cols()) = law_;
    Eigen::Index at = law_.cols();
    for (const Cause& cause : accepted_) {
      design.middleCols(at, cause.errors.cols()) = ColumnsOf(cause.errors);
      at += cause.errors.cols();
    }
    design.rightCols(more.cols()) = more;
    return design;
  }

  // The most likely scatter of the single readings, by the golden section in its logarithm.
  Solved Solve(const Eigen::MatrixXd& design) const {
    const auto at = [&](double scatter_mm) {
      Solved solved = SolveAt(design, values_, variances_ + (gains_ * scatter_mm).square());
      solved.scatter_mm = scatter_mm;
      return solved;
    };
    const double most_mm = half_mm_;
    Solved best = at(0);
    constexpr int kSteps = 12;
    int best_step = -1;
    const auto of_step = [&](double step) { return most_mm * std::pow(2.0, -step); };
    for (int step = 0; step < kSteps; ++step) {
      Solved solved = at(of_step(step));
      if (solved.minus_two_log < best.minus_two_log) {
        best = std::move(solved);
        best_step = step;
      }
    }
    if (best_step < 0) return best;
    double low = best_step - 1, high = best_step + 1;
    constexpr int kRefinements = 10;
    constexpr double kGolden = 0.381966;
    for (int i = 0; i < kRefinements; ++i) {
      Solved a = at(of_step(low + kGolden * (high - low)));
      Solved b = at(of_step(high - kGolden * (high - low)));
      const bool is_left = a.minus_two_log < b.minus_two_log;
      Solved& nearer = is_left ? a : b;
      if (nearer.minus_two_log < best.minus_two_log) best = nearer;
      (is_left ? high : low) =
          is_left ? high - kGolden * (high - low) : low + kGolden * (high - low);
    }
    return best;
  }

  // ---- causes ----
  std::optional<Cause> Backlash() const {
    Cause cause;
    cause.kind = Kind::kBacklash;
    cause.errors = Eigen::MatrixXd::Zero(n_, 1);
    for (Eigen::Index i = 0; i < n_; ++i) cause.errors(i, 0) = IsFalling(FrameOf(i)) ? 1 : 0;
    const double back = cause.errors.sum();
    if (back < kMinOnEachSide || static_cast<double>(n_) - back < kMinOnEachSide)
      return std::nullopt;
    return cause;
  }

  // The sum of squares that is left with these columns, with the weights of the fit without them.
  double Rest(const Eigen::MatrixXd& more) const {
    const Eigen::MatrixXd design = screen_roots_.matrix().asDiagonal() * Design(more);
    const Eigen::VectorXd right = (screen_roots_ * values_.array()).matrix();
    return (right - design * design.colPivHouseholderQr().solve(right)).squaredNorm();
  }

  // Jumps between two neighbours in an order of the samples. `place` is that of the first sample
  // after the jump.
  template <typename PlaceOf>
  std::optional<Cause> Jump(Kind kind, const PlaceOf& place_of) const {
    std::vector<Eigen::Index> order(static_cast<std::size_t>(n_));
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(),
                     [&](Eigen::Index a, Eigen::Index b) { return place_of(a) < place_of(b); });
    const auto errors_from = [&](Eigen::Index k) {
      Eigen::MatrixXd errors = Eigen::MatrixXd::Zero(n_, 1);
      for (Eigen::Index j = k; j < n_; ++j) errors(order[static_cast<std::size_t>(j)], 0) = 1;
      return errors;
    };
    std::optional<Eigen::Index> best;
    double least = std::numeric_limits<double>::infinity();
    const auto try_at = [&](Eigen::Index k) {
      if (k < kMinOnEachSide || k > n_ - kMinOnEachSide) return;
      const double rest = Rest(ColumnsOf(errors_from(k)));
      if (!(rest < least)) return;
      least = rest;
      best = k;
    };
    const Eigen::Index step = std::max<Eigen::Index>(1, n_ / kMaxPlaces);
    for (Eigen::Index k = kMinOnEachSide; k + kMinOnEachSide <= n_; k += step) try_at(k);
    if (!best) return std::nullopt;
    for (Eigen::Index k = *best - step + 1, end = *best + step; k < end; ++k) try_at(k);
    Cause cause;
    cause.kind = kind;
    cause.place = place_of(order[static_cast<std::size_t>(*best)]);
    cause.errors = errors_from(*best);
    cause.choices = static_cast<double>(n_ - 2 * kMinOnEachSide + 1);
    return cause;
  }

  std::optional<Cause> Slip() const {
    const auto n = static_cast<std::size_t>(n_);
    std::size_t back = 0;
    for (std::size_t i = 0; i < n; ++i) back += falling_[evidence_.frames[i]] ? 1U : 0U;
    if (back == 0 || back == n) return std::nullopt;  // the same as a jump at a place
    return Jump(Kind::kSlip, [this](Eigen::Index i) { return static_cast<double>(FrameOf(i)); });
  }

  Eigen::MatrixXd Waves(double period_mm) const {
    Eigen::MatrixXd errors(n_, 2);
    errors.col(0) = (2 * kPi / period_mm * corrected_).sin().matrix();
    errors.col(1) = (2 * kPi / period_mm * corrected_).cos().matrix();
    return errors;
  }

  // The median distance of one frame from the next, or less where the order of the frames has
  // nothing to do with the readings.
  double MedianStepMm() const {
    std::vector<double> steps;
    for (Eigen::Index i = 1; i < n_; ++i) {
      const double step_mm = std::abs(corrected_[i] - corrected_[i - 1]);
      if (step_mm > 0) steps.push_back(step_mm);
    }
    const double range_mm = corrected_.maxCoeff() - corrected_.minCoeff();
    return std::min(Median(steps), kMaxRuns * range_mm / static_cast<double>(n_));
  }

  // The part of waves that the law does not take up, relative to all of it. At some periods all
  // frames of a run have one phase, so that waves of any amplitude look alike.
  double ShareBeyondLaw(const Eigen::MatrixXd& waves) const {
    const Eigen::MatrixXd law =
        screen_roots_.matrix().asDiagonal() * Design(Eigen::MatrixXd(n_, 0));
    const Eigen::MatrixXd scaled = screen_roots_.matrix().asDiagonal() * ColumnsOf(waves);
    const Eigen::MatrixXd beyond = scaled - law * law.colPivHouseholderQr().solve(scaled);
    // The smaller singular value of both columns, against their size.
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(beyond);
    return svd.singularValues().minCoeff() / (scaled.norm() / std::sqrt(2.0));
  }

  std::optional<Cause> Periodic() const {
    const double range_mm = corrected_.maxCoeff() - corrected_.minCoeff();
    const double fastest = 1 / (kShortestPeriod * MedianStepMm());
    const double slowest = kPeriodsOfSweep / range_mm;
    if (!(fastest > slowest)) return std::nullopt;
    const double step = 1 / (kPeriodsPerPeak * range_mm);
    double best = 0, least = std::numeric_limits<double>::infinity();
    const auto try_at = [&](double frequency) {
      const Eigen::MatrixXd waves = Waves(1 / frequency);
      const double rest = Rest(ColumnsOf(waves));
      if (!(rest < least) || !(ShareBeyondLaw(waves) > kMinBeyondLaw)) return;
      least = rest;
      best = frequency;
    };
    constexpr int kMaxFrequencies = 1000;
    const double used_step = std::max(step, (fastest - slowest) / kMaxFrequencies);
    for (double f = slowest; f <= fastest; f += used_step) try_at(f);
    for (double fine = used_step / 2; fine > used_step / 50; fine /= 2) {
      const double around = best;
      if (around - fine > 0) try_at(around - fine);
      try_at(around + fine);
    }
    if (best == 0) return std::nullopt;
    Cause cause;
    cause.kind = Kind::kPeriodic;
    cause.place = 1 / best;
    cause.errors = Waves(cause.place);
    cause.choices = std::max(1.0, (fastest - slowest) * range_mm);
    return cause;
  }

  void FindCost(Cause* cause) const {
    const bool is_bend = cause->kind == Kind::kBend;
    const Eigen::MatrixXd more = is_bend ? cause->errors : ColumnsOf(cause->errors);
    const Solved solved = Solve(Design(more));
    cause->amplitudes = solved.values.tail(more.cols());
    cause->covariance = solved.covariance.bottomRightCorner(more.cols(), more.cols());
    cause->scatter_mm = solved.scatter_mm;
    cause->cost = solved.minus_two_log +
                  static_cast<double>(more.cols()) * std::log(static_cast<double>(n_)) +
                  2 * std::log(cause->choices);
  }

  // Accepts the next error of the stage. Returns false where there is none, or where it is open.
  bool FindNext(StageComparison* result) {
    Prepare();
    for (Cause& cause : accepted_) {
      if (cause.kind == Kind::kPeriodic) cause.errors = Waves(cause.place);
    }
    const Solved none = Solve(Design(Eigen::MatrixXd(n_, 0)));
    const Eigen::ArrayXd variances = variances_ + (gains_ * none.scatter_mm).square();
    const Eigen::ArrayXd u2 =
        (values_ - Design(Eigen::MatrixXd(n_, 0)) * none.values).array().square() / variances;
    screen_roots_ = ((kFreedom + 1) / (kFreedom + u2) / variances).sqrt();
    std::vector<Cause> causes;
    const auto add = [&](std::optional<Cause> cause) {
      if (!cause) return;
      for (const Cause& known : accepted_) {
        if (known.kind == cause->kind && known.kind != Kind::kPeriodic) return;
      }
      FindCost(&*cause);
      causes.push_back(std::move(*cause));
    };
    Cause bend;
    bend.kind = Kind::kBend;
    bend.errors = bend_;
    add(bend);
    add(Backlash());
    add(Slip());
    add(Jump(Kind::kJump, [this](Eigen::Index i) { return corrected_[i]; }));
    add(Periodic());
    std::sort(causes.begin(), causes.end(),
              [](const Cause& a, const Cause& b) { return a.cost < b.cost; });
    if (causes.empty() || !(causes.front().cost < none.minus_two_log - kDecisiveAgainstNone) ||
        !(causes.front().scatter_mm < kLargestScatter * half_mm_))
      return false;
    std::vector<const Cause*> close;
    for (const Cause& cause : causes) {
      if (cause.cost < causes.front().cost + kDecisiveOdds &&
          cause.cost < none.minus_two_log - kDecisiveAgainstNone)
        close.push_back(&cause);
    }
    for (const Cause* cause : close)
      result->may_be_jump = result->may_be_jump || cause->kind == Kind::kJump;
    const bool is_of_stage =
        causes.front().kind != Kind::kBend && causes.front().kind != Kind::kJump;
    bool is_one = is_of_stage;
    for (const Cause* cause : close) is_one = is_one && IsSameCorrection(*close.front(), *cause);
    if (is_one) {
      // A cause without a chosen place comes before others with the same correction. In a sweep
      // with one turn, steps that are lost there are backlash, whatever the odds of such a place.
      const auto first =
          std::min_element(close.begin(), close.end(),
                           [](const Cause* a, const Cause* b) { return a->choices < b->choices; });
      const Cause accepted = **first;
      for (const Cause& cause : causes) {
        const bool is_close = std::find(close.begin(), close.end(), &cause) != close.end();
        const bool is_turn = accepted.kind == Kind::kBacklash && cause.kind == Kind::kSlip &&
                             IsSameCorrection(accepted, cause);
        if (cause.kind != accepted.kind && (is_close || is_turn))
          result->errors.also_possible.push_back(InWords(cause));
      }
      Accept(accepted);
      return true;
    }
    // A bend or a jump alone is examined elsewhere.
    if (close.size() < 2) return false;
    for (const Cause* cause : close) {
      // They would come in addition to a cause that was accepted, and not in its place.
      if (accepted_.empty()) result->errors.also_possible.push_back(InWords(*cause));
      result->open.push_back({InWords(*cause), error_mm_ + OnFrames(*cause, cause->amplitudes)});
    }
    if (accepted_.empty()) result->errors.message = "several causes remain";
    return false;
  }

  // The change by a cause that the law does not take up, for each sample.
  Eigen::VectorXd BeyondLaw(const Cause& cause) const {
    const Eigen::MatrixXd columns =
        cause.kind == Kind::kBend ? cause.errors : ColumnsOf(cause.errors);
    const Eigen::VectorXd change = columns * cause.amplitudes;
    const Eigen::MatrixXd law = screen_roots_.matrix().asDiagonal() * law_;
    const Eigen::VectorXd scaled = (screen_roots_ * change.array()).matrix();
    return scaled - law * law.colPivHouseholderQr().solve(scaled);
  }

  bool IsSameCorrection(const Cause& one, const Cause& other) const {
    if (&one == &other) return true;
    if (other.kind == Kind::kBend) return false;
    const Eigen::VectorXd change = BeyondLaw(one);
    return (change - BeyondLaw(other)).norm() < kSameCorrection * change.norm();
  }

  // The error of each frame of the sweep for given amplitudes.
  Eigen::VectorXd OnFrames(const Cause& cause, const Eigen::VectorXd& amplitudes) const {
    Eigen::VectorXd errors = Eigen::VectorXd::Zero(error_mm_.size());
    for (Eigen::Index f = 0; f < errors.size(); ++f) {
      const auto frame = static_cast<std::size_t>(f);
      const double reading_mm = of_sweep_[f] - error_mm_[f];
      switch (cause.kind) {
        case Kind::kBacklash:
          errors[f] = falling_[frame] ? amplitudes[0] : 0;
          break;
        case Kind::kSlip:
          errors[f] = static_cast<double>(f) >= cause.place ? amplitudes[0] : 0;
          break;
        case Kind::kJump:
          errors[f] = reading_mm >= cause.place ? amplitudes[0] : 0;
          break;
        case Kind::kPeriodic:
          errors[f] = amplitudes[0] * std::sin(2 * kPi * reading_mm / cause.place) +
                      amplitudes[1] * std::cos(2 * kPi * reading_mm / cause.place);
          break;
        case Kind::kBend:
          break;
      }
    }
    return errors;
  }

  // Adds a cause, and solves all of them together: the law is not linear in the readings.
  void Accept(const Cause& cause) {
    accepted_.push_back(cause);
    constexpr int kNewton = 4;
    std::vector<Eigen::VectorXd> total(accepted_.size());
    for (std::size_t i = 0; i < accepted_.size(); ++i)
      total[i] = i + 1 < accepted_.size()
                     ? accepted_[i].amplitudes
                     : Eigen::VectorXd(Eigen::VectorXd::Zero(cause.errors.cols()));
    for (int step = 0; step < kNewton; ++step) {
      Prepare();
      for (Cause& each : accepted_) {
        if (each.kind == Kind::kPeriodic) each.errors = Waves(each.place);
      }
      const Solved solved = Solve(Design(Eigen::MatrixXd(n_, 0)));
      Eigen::Index at = law_.cols();
      for (std::size_t i = 0; i < accepted_.size(); ++i) {
        const Eigen::Index count = accepted_[i].errors.cols();
        total[i] += solved.values.segment(at, count);
        accepted_[i].amplitudes = total[i];
        accepted_[i].covariance = solved.covariance.block(at, at, count, count);
        at += count;
      }
      error_mm_.setZero();
      Eigen::VectorXd all = Eigen::VectorXd::Zero(error_mm_.size());
      for (std::size_t i = 0; i < accepted_.size(); ++i) all += OnFrames(accepted_[i], total[i]);
      error_mm_ = all;
    }
  }

  // The period's standard deviation by the curvature of the sum of squares around it.
  double PeriodSigma(const Cause& cause) const {
    const double amplitude = cause.amplitudes.norm();
    const double sigma = std::sqrt(0.5 * cause.covariance.trace());
    // d error/d(1/period) = 2 pi amplitude (reading - middle), whose root mean square over an even
    // sweep is 1/sqrt(3) of that at its end.
    const double by_frequency = 2 * kPi * amplitude * half_mm_ / std::sqrt(3.0);
    return by_frequency > 0 ? cause.place * cause.place * sigma / by_frequency : 0;
  }

  void Report(StageComparison* result) const {
    for (const Cause& cause : accepted_) {
      const double sigma = std::sqrt(cause.covariance(0, 0));
      if (cause.kind == Kind::kBacklash)
        result->errors.backlash_mm = model::Estimate{cause.amplitudes[0], sigma};
      if (cause.kind == Kind::kSlip) {
        result->errors.slip_mm = model::Estimate{cause.amplitudes[0], sigma};
        result->errors.slip_from_frame = static_cast<int>(cause.place);
      }
      if (cause.kind == Kind::kPeriodic && !result->errors.periodic) {
        PeriodicError error;
        error.amplitude_mm = {cause.amplitudes.norm(), std::sqrt(0.5 * cause.covariance.trace())};
        error.period_mm = {cause.place, PeriodSigma(cause)};
        error.phase_deg = std::atan2(cause.amplitudes[1], cause.amplitudes[0]) * 180 / kPi;
        result->errors.periodic = error;
      }
      for (Eigen::Index k = 0; k < cause.amplitudes.size(); ++k) {
        for (const double side : {-kAmplitudeReach, kAmplitudeReach}) {
          const Eigen::VectorXd change = Eigen::VectorXd::Unit(cause.amplitudes.size(), k) * side *
                                         std::sqrt(cause.covariance(k, k));
          result->changed_mm.push_back(error_mm_ + OnFrames(cause, change));
        }
      }
    }
  }

  std::string InWords(const Cause& cause) const {
    const auto amount = [&] {
      return fmt::format("{:+.2g} +- {:.1g} mm", cause.amplitudes[0],
                         std::sqrt(cause.covariance(0, 0)));
    };
    switch (cause.kind) {
      case Kind::kBacklash:
        return fmt::format("backlash of the stage ({} at falling readings)", amount());
      case Kind::kSlip: {
        const model::SweepFrame& frame = sweep_.frames[static_cast<std::size_t>(cause.place)];
        return fmt::format(
            "lost steps or a slipped clamp ({} from {} on, in the order of the "
            "frames)",
            amount(), FileName(frame.Name()));
      }
      case Kind::kJump:
        return fmt::format("a jump of the readings ({} from the reading {:.6g} mm on)", amount(),
                           cause.place);
      case Kind::kPeriodic:
        return fmt::format(
            "a periodic error, as of a lead screw (amplitude {:.2g} mm, period "
            "{:.3g} mm)",
            cause.amplitudes.norm(), cause.place);
      case Kind::kBend:
        return evidence_.is_parabola_in_reading
                   ? "a blur that does not follow the law (a bend of the readings, or the shape of "
                     "the blur)"
                   : "a bend of the readings against the image scale (a lens that distorts or "
                     "breathes, or a scale that is not linear)";
    }
    return "";
  }

  const FocusSweep& sweep_;
  const ReadingEvidence& evidence_;
  std::vector<bool> falling_;
  Eigen::Index n_;
  Eigen::VectorXd of_sweep_;  // for each frame of the sweep
  Eigen::VectorXd readings_, error_mm_, values_;
  Eigen::ArrayXd corrected_, gains_, variances_, screen_roots_;
  Eigen::MatrixXd law_, bend_;
  double lowest_mm_ = 0, half_mm_ = 0;
  std::vector<Cause> accepted_;
};

}  // namespace

ReadingEvidence EvidenceOfScales(const std::vector<ScaleSample>& samples) {
  ReadingEvidence evidence;
  std::vector<double> values, sigmas;
  // The samples are in the order of their registration, and lost steps need that of the frames.
  std::vector<ScaleSample> in_order = samples;
  std::sort(in_order.begin(), in_order.end(),
            [](const ScaleSample& a, const ScaleSample& b) { return a.frame < b.frame; });
  for (const ScaleSample& sample : in_order) {
    if (sample.scale_is_from_reading) continue;
    evidence.frames.push_back(sample.frame);
    values.push_back(1 / sample.scale);
    sigmas.push_back(sample.registration.scale_sigma / (sample.scale * sample.scale));
  }
  evidence.values =
      Eigen::Map<Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
  evidence.sigmas =
      Eigen::Map<Eigen::VectorXd>(sigmas.data(), static_cast<Eigen::Index>(sigmas.size()));
  return evidence;
}

double ReadingErrorOf(const ReadingEvidence& evidence, const FocusSweep& sweep) {
  return Comparison(evidence, sweep).ReadingErrorMm();
}

std::vector<bool> ApproachedFalling(const Eigen::VectorXd& readings_mm) {
  const auto n = static_cast<std::size_t>(readings_mm.size());
  std::vector<bool> falling(n, false);
  bool is_known = false;
  for (std::size_t i = 1; i < n; ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    const double change = readings_mm[at] - readings_mm[at - 1];
    falling[i] = change == 0 ? falling[i - 1] : change < 0;
    if (is_known || change == 0) continue;
    is_known = true;
    std::fill(falling.begin(), falling.begin() + static_cast<std::ptrdiff_t>(i), falling[i]);
  }
  std::vector<std::size_t> isolated;
  for (std::size_t i = 1; i + 1 < n; ++i) {
    if (falling[i] != falling[i - 1] && falling[i] != falling[i + 1]) isolated.push_back(i);
  }
  if (static_cast<double>(isolated.size()) <=
      std::max(kFewFlips, kIsolatedFlips * static_cast<double>(n))) {
    for (const std::size_t i : isolated) falling[i] = falling[i - 1];
  }
  return falling;
}

StageComparison CompareStageErrors(const ReadingEvidence& evidence, const FocusSweep& sweep) {
  return Comparison(evidence, sweep).Run();
}

bool ScalesContradict(const std::vector<ScaleSample>& samples, const Eigen::VectorXd& before_mm,
                      const Eigen::VectorXd& after_mm) {
  constexpr double kContradicts = 2;
  constexpr Eigen::Index kMinSamples = 6;
  std::vector<const ScaleSample*> measured;
  for (const ScaleSample& sample : samples) {
    if (!sample.scale_is_from_reading) measured.push_back(&sample);
  }
  const auto n = static_cast<Eigen::Index>(measured.size());
  if (n < kMinSamples) return false;
  Eigen::MatrixXd law(n, 3);
  Eigen::VectorXd before(n), after(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const ScaleSample& sample = *measured[static_cast<std::size_t>(i)];
    const double x = 1 / sample.scale - 1;
    law.row(i) << 1, x, x * x;
    before[i] = before_mm[static_cast<Eigen::Index>(sample.frame)];
    after[i] = after_mm[static_cast<Eigen::Index>(sample.frame)];
  }
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(law);
  const auto sum_of_squares = [&](const Eigen::VectorXd& readings) {
    return (readings - law * solver.solve(readings)).squaredNorm();
  };
  const double rss_before = sum_of_squares(before), rss_after = sum_of_squares(after);
  return rss_before > 0 && static_cast<double>(n) * std::log(rss_after / rss_before) > kContradicts;
}

}  // namespace thicklens::calib
