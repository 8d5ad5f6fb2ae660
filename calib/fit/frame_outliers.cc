#include "calib/fit/frame_outliers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinFrames = 5;
// A frame whose spectrum scatters more than the others' by this factor, in power, does not show
// what the others show.
constexpr double kScatterOfDamage = 30;

// There may be two errors because both sides of focus have the same blur.
std::string InWords(const std::vector<double>& errors_mm) {
  if (errors_mm.empty()) return "frame damaged";
  if (errors_mm.size() == 1)
    return fmt::format("reading off by {:.1f} mm, or frame damaged", errors_mm[0]);
  return fmt::format("reading off by {:.1f} mm (or {:.1f}, beyond focus), or frame damaged",
                     errors_mm[0], errors_mm[1]);
}

class Outliers {
 public:
  Outliers(model::BenchDirection direction, BlurEvidence* evidence, Calibration* calibration)
      : sign_(model::DirectionSign(direction)), evidence_(*evidence), result_(*calibration) {}

  std::optional<std::string> RejectOutlier() {
    RejectScattered();
    for (BlurSamples& estimator : evidence_.setup.estimators) RejectOffParabola(estimator);
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
      if (!(ratio > kScatterOfDamage)) continue;
      Frame(f).rejection = fmt::format(
          "does not show what the others show: its spectrum deviates {:.0f} times more than theirs "
          "(the frame is smeared, the target moved during the exposure or was covered, or it is so "
          "far out of focus that the blur law does not hold)",
          std::sqrt(ratio));
    }
  }

  // On the target any blur follows a parabola in depth, whatever floor and texture. A frame that is
  // far off the parabola has a wrong reading or is damaged.
  void RejectOffParabola(const BlurSamples& estimator) {
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
      FrameMeasurement& frame = Frame(estimator.frames[s]);
      if (parabola.follows[s] || !frame.rejection.empty()) continue;
      const double off = parabola.residuals_px2[i] / parabola.sigmas_px2[i];
      // The written reading minus that of the parabola.
      std::vector<double> errors_mm;
      for (const double depth_mm : parabola.DepthsOf(estimator.variances_px2[i], depths[i])) {
        if (std::abs(depths[i] - depth_mm) < range_mm)
          errors_mm.push_back(sign_ * (depths[i] - depth_mm));
      }
      if (!errors_mm.empty()) frame.reading_error_mm = errors_mm.front();
      frame.rejection = fmt::format(
          "{}: its blur deviates by {:.0f} standard deviations from the law of the other frames",
          InWords(errors_mm), std::abs(off));
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

  double sign_;
  BlurEvidence& evidence_;
  Calibration& result_;
};

}  // namespace

std::optional<std::string> RejectOutliers(model::BenchDirection direction, BlurEvidence* evidence,
                                          Calibration* calibration) {
  return Outliers(direction, evidence, calibration).RejectOutlier();
}

}  // namespace thicklens::calib
