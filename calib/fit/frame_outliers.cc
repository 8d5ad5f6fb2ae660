#include "calib/fit/frame_outliers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/sweep/frame_selection.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinFrames = 5;
constexpr double kScatterOfDamage = 30;  // over that of the other frames, in power
// Part of its own spectrum, in power. The errors of the blur law leave less than 0.0001 in a clean
// frame without noise, and a smear of 15 px leaves 0.008.
constexpr double kMisfitOfDamage = 0.001;

// Part of the median step by which the reading that a blur shows may miss that of another frame.
constexpr double kSwappedWithin = 0.5;

// A frame whose blur does not belong to its reading.
struct OffParabola {
  std::size_t fit_frame = 0;
  // The written reading minus those that the blur shows: two, because both sides of focus have the
  // same blur.
  std::vector<double> errors_mm;
  double deviation = 0;  // standard deviations
};

// Digits behind the point of millimetres that show a tenth of a step.
int DigitsOfStep(double step_mm) {
  const int digits = step_mm > 0 ? static_cast<int>(std::ceil(1 - std::log10(step_mm))) : 1;
  return std::clamp(digits, 1, 7);
}

class Outliers {
 public:
  Outliers(const FocusSweep& sweep, BlurEvidence* evidence, Calibration* calibration)
      : sweep_(sweep),
        sign_(model::DirectionSign(sweep.direction)),
        evidence_(*evidence),
        result_(*calibration) {}

  std::optional<std::string> RejectOutlier() {
    RejectScattered();
    for (BlurSamples& estimator : evidence_.setup.estimators) FindOffParabola(estimator);
    RejectOffParabola();
    for (BlurSamples& estimator : evidence_.setup.estimators) DropRejected(&estimator);
    std::size_t most = 0;
    for (const BlurSamples& estimator : evidence_.setup.estimators)
      most = std::max(most, estimator.frames.size());
    if (most >= kMinFrames) return std::nullopt;
    return fmt::format("the blur of only {} frames follows one law, but {} frames are needed", most,
                       kMinFrames);
  }

 private:
  FrameMeasurement& Frame(std::size_t fit_frame) {
    return result_.frames[evidence_.frames[fit_frame]];
  }

  void RejectScattered() {
    std::vector<double> ratios;
    for (const double r : evidence_.frame_noise_ratios) {
      if (r > 0) ratios.push_back(r);
    }
    if (ratios.empty()) return;
    const double typical = Median(ratios);
    for (std::size_t f = 0; f < evidence_.frame_noise_ratios.size(); ++f) {
      const double ratio = evidence_.frame_noise_ratios[f] / typical;
      if (!IsDamage(ratio, evidence_.frame_misfits[f])) continue;
      Frame(f).rejection = fmt::format(
          "does not show what the others show: its spectrum deviates {:.0f} times more than theirs "
          "(the frame is smeared, the target moved during the exposure or was covered, or it is so "
          "far out of focus that the blur law does not hold)",
          std::sqrt(ratio));
    }
  }

  // On the target any blur follows a parabola in depth, whatever floor and texture. A frame that is
  // far off the parabola has a wrong reading or is damaged.
  void FindOffParabola(const BlurSamples& estimator) {
    const auto n = static_cast<Eigen::Index>(estimator.frames.size());
    Eigen::VectorXd depths(n);
    for (Eigen::Index i = 0; i < n; ++i)
      depths[i] = Frame(estimator.frames[static_cast<std::size_t>(i)]).depth_mm;
    const Parabola parabola =
        FitParabola(depths, estimator.variances_px2, estimator.covariance.diagonal().cwiseSqrt(),
                    evidence_.setup.reading_sigma_mm);
    if (!parabola.done) return;
    const double range_mm = depths.maxCoeff() - depths.minCoeff();
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto s = static_cast<std::size_t>(i);
      const FrameMeasurement& frame = Frame(estimator.frames[s]);
      const bool is_known = std::any_of(off_.begin(), off_.end(), [&](const OffParabola& one) {
        return one.fit_frame == estimator.frames[s];
      });
      if (parabola.follows[s] || !frame.rejection.empty() || is_known) continue;
      OffParabola off;
      off.fit_frame = estimator.frames[s];
      off.deviation = std::abs(parabola.residuals_px2[i] / parabola.sigmas_px2[i]);
      for (const double depth_mm : parabola.DepthsOf(estimator.variances_px2[i], depths[i])) {
        if (std::abs(depths[i] - depth_mm) < range_mm)
          off.errors_mm.push_back(sign_ * (depths[i] - depth_mm));
      }
      off_.push_back(std::move(off));
    }
  }

  double StepMm() const {
    std::vector<double> readings, steps;
    for (const FrameMeasurement& frame : result_.frames) readings.push_back(frame.reading_mm);
    std::sort(readings.begin(), readings.end());
    for (std::size_t i = 1; i < readings.size(); ++i) {
      if (readings[i] > readings[i - 1]) steps.push_back(readings[i] - readings[i - 1]);
    }
    return Median(steps);
  }

  // Whether the blur of one frame belongs to the reading of the other.
  bool ShowsReadingOf(const OffParabola& one, const OffParabola& other, double step_mm) {
    const double apart_mm = Frame(one.fit_frame).reading_mm - Frame(other.fit_frame).reading_mm;
    return std::any_of(one.errors_mm.begin(), one.errors_mm.end(), [&](double error_mm) {
      return std::abs(error_mm - apart_mm) < kSwappedWithin * step_mm;
    });
  }

  void RejectOffParabola() {
    const double step_mm = StepMm();
    for (const OffParabola& off : off_) {
      FrameMeasurement& frame = Frame(off.fit_frame);
      const int digits = DigitsOfStep(step_mm);
      const auto right = [&](std::size_t i) { return frame.reading_mm - off.errors_mm[i]; };
      const auto error = [&](std::size_t i) {
        return ReadingErrorInWords(sweep_, frame.reading_mm, right(i), digits);
      };
      const auto shown = [&](std::size_t i) { return ReadingInWords(sweep_, right(i), digits); };
      std::string what = "frame damaged", belongs;
      if (!off.errors_mm.empty()) {
        frame.reading_error_mm = off.errors_mm.front();
        const bool has_two = off.errors_mm.size() > 1;
        what = fmt::format("reading off by {}{}, or frame damaged", error(0),
                           has_two ? " (or " + error(1) + ", beyond focus)" : std::string());
        belongs = fmt::format(", and belongs to the reading {}{}", shown(0),
                              has_two ? " or " + shown(1) : std::string());
      }
      frame.rejection = fmt::format(
          "{}: its blur deviates by {:.0f} standard deviations from the law of the other frames{}",
          what, off.deviation, belongs);
      for (const OffParabola& other : off_) {
        if (&other == &off || !ShowsReadingOf(off, other, step_mm) ||
            !ShowsReadingOf(other, off, step_mm))
          continue;
        frame.rejection += "; swapped with " + FileName(Frame(other.fit_frame).image);
        break;
      }
    }
  }

  void DropRejected(BlurSamples* estimator) {
    std::vector<Eigen::Index> kept;
    BlurSamples rest = *estimator;
    rest.frames.clear();
    for (std::size_t i = 0; i < estimator->frames.size(); ++i) {
      if (!Frame(estimator->frames[i]).rejection.empty()) continue;
      kept.push_back(static_cast<Eigen::Index>(i));
      rest.frames.push_back(estimator->frames[i]);
    }
    rest.variances_px2 = estimator->variances_px2(kept);
    rest.covariance = estimator->covariance(kept, kept);
    *estimator = std::move(rest);
  }

  const FocusSweep& sweep_;
  double sign_;
  BlurEvidence& evidence_;
  Calibration& result_;
  std::vector<OffParabola> off_;
};

}  // namespace

bool IsDamage(double scatter, double misfit) {
  return scatter > kScatterOfDamage && misfit > kMisfitOfDamage;
}

std::optional<std::string> RejectOutliers(const FocusSweep& sweep, BlurEvidence* evidence,
                                          Calibration* calibration) {
  return Outliers(sweep, evidence, calibration).RejectOutlier();
}

}  // namespace thicklens::calib
