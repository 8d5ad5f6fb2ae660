#include "calib/calibrate/zero_choice.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/fit/blur_measurement.h"
#include "calib/fit/known_focus.h"
#include "calib/registration/target_period.h"
#include "calib/uncertainty/calibration_checks.h"
#include "calib/uncertainty/systematic_advice.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

constexpr double kSeenBlurPx2 = 2;  // added variance that stands out
// Standard deviation of a stated period relative to it: prints and rulers are good to about that.
constexpr double kPeriodError = 0.003;
constexpr double kReach = 2;  // standard deviations of the other depth that the intervals include
constexpr double kContradicts = 3;               // standard deviations
constexpr double kSmallestContradiction = 1e-3;  // of zf

}  // namespace

std::optional<model::StatedConjugate> MagnificationOfPeriod(const FocusSweep& sweep,
                                                            const cv::Mat& grey,
                                                            double beyond_focus_mm) {
  if (!sweep.target_period_mm) return std::nullopt;
  const std::optional<PeriodEstimate> period = MeasurePeriodPx(grey);
  if (!period) return std::nullopt;
  const double in_frame =
      period->period_px * sweep.camera.sensor.pixel_pitch_mm / *sweep.target_period_mm;
  const double f1_mm = sweep.camera.lens.front_focal_length_mm;
  double magnification = in_frame;
  constexpr int kRounds = 20;  // each divides the error by about zf over the distance
  for (int round = 0; round < kRounds; ++round) {
    const double zf_mm = f1_mm * (1 + 1 / magnification);
    const double at_focus = in_frame * (zf_mm + beyond_focus_mm) / zf_mm;
    if (!(at_focus > 0)) return std::nullopt;
    magnification = at_focus;
  }
  model::StatedConjugate stated;
  stated.kind = model::ConjugateKind::kMagnification;
  stated.value = {magnification,
                  magnification * std::hypot(period->sigma_px / period->period_px, kPeriodError)};
  stated.name = kFromPeriod;
  return stated;
}

std::optional<model::StatedConjugate> MostPrecise(
    const model::Camera& camera, const std::vector<model::StatedConjugate>& statements) {
  const auto sigma_mm = [&](const model::StatedConjugate& stated) {
    return FocusDepthWithTolerance(camera, stated).sigma;
  };
  const auto best =
      std::min_element(statements.begin(), statements.end(),
                       [&](const auto& a, const auto& b) { return sigma_mm(a) < sigma_mm(b); });
  if (best == statements.end()) return std::nullopt;
  return *best;
}

// [D131] sigma = kappa (r/p) f1/(zf (zf - f1)) |reading - reading at focus|, solved for zf.
double UsualFocusDepth(const model::Camera& camera, const std::vector<ScaleSample>& samples,
                       double sharpest_reading_mm) {
  const double f1_mm = camera.lens.front_focal_length_mm;
  std::vector<double> slopes;  // px per mm
  for (const ScaleSample& sample : samples) {
    const std::optional<double>& added_px2 = sample.registration.added_variance_px2;
    if (!added_px2 || !(*added_px2 > kSeenBlurPx2)) continue;
    slopes.push_back(std::sqrt(*added_px2) / std::abs(sample.reading_mm - sharpest_reading_mm));
  }
  if (slopes.empty() || !std::isfinite(Median(slopes))) return 2 * f1_mm;
  const double product_mm2 = kDefaultRatio * camera.lens.aperture_radius_mm /
                             camera.sensor.pixel_pitch_mm * f1_mm / Median(slopes);
  return 0.5 * (f1_mm + std::sqrt(f1_mm * f1_mm + 4 * product_mm2));
}

std::vector<FocusComparison> CompareFocus(const FocusSweep& sweep,
                                          const std::vector<model::StatedConjugate>& statements,
                                          const model::Estimate& found_mm,
                                          const Calibration& calibration) {
  std::vector<FocusComparison> comparisons;
  if (!calibration.summary.bench_offset_mm) return comparisons;
  const double offset_mm = calibration.summary.bench_offset_mm->value;
  const std::string& origin = calibration.diagnostics.bench_offset_from;
  double found_sigma_mm = found_mm.sigma;
  const auto compare = [&](const std::string& name, double focus_mm, double sigma_mm) {
    const double apart_mm = focus_mm - found_mm.value;
    const double both_mm = std::hypot(sigma_mm, found_sigma_mm);
    FocusComparison comparison;
    comparison.source.name = name;
    comparison.source.focus_depth_mm = {focus_mm, sigma_mm};
    comparison.source.agrees =
        !(std::abs(apart_mm) > kContradicts * both_mm + kSmallestContradiction * found_mm.value);
    if (comparison.source.agrees) {
      comparisons.push_back(comparison);
      return;
    }
    comparison.text = fmt::format(
        "{} puts the in-focus object distance at {:.5g} +- {:.2g} mm, {:+.3g} mm from that by {} "
        "({:.5g} "
        "+- {:.2g} mm): one of them, the focal length, the pixel pitch or the unit of the readings "
        "is wrong{}",
        name, focus_mm, sigma_mm, apart_mm, origin, found_mm.value, found_sigma_mm,
        name == kFromScale
            ? ", or the entrance pupil of the lens is not at its front principal plane, "
              "from which the image scale measures"
            : "");
    comparisons.push_back(comparison);
  };
  for (const model::StatedConjugate& stated : statements) {
    if (stated.name == origin) found_sigma_mm = FocusDepthWithTolerance(sweep.camera, stated).sigma;
  }
  const ScaleModel& scale = calibration.diagnostics.scale;
  if (scale.done && !sweep.camera.objective && origin != kFromScale && origin != kFromOffset) {
    // No pupil law is known to hold: the zero may lie anywhere in the interval of the laws.
    const Eigen::Vector2d& laws_mm = scale.offset_of_pupil_laws_mm;
    compare(kFromScale,
            found_mm.value + std::clamp(offset_mm, laws_mm.x(), laws_mm.y()) - offset_mm,
            scale.offset_mm.sigma);
  }
  if (sweep.offset_mm && origin != kFromOffset)
    compare(kFromOffset, found_mm.value + sweep.offset_mm->value - offset_mm,
            sweep.offset_mm->sigma);
  for (const model::StatedConjugate& stated : statements) {
    if (stated.name == origin) continue;
    const model::Estimate focus_mm = FocusDepthWithTolerance(sweep.camera, stated);
    compare(stated.name, focus_mm.value, focus_mm.sigma);
  }
  return comparisons;
}

void CompareWithStatements(const FocusSweep& sweep,
                           const std::vector<model::StatedConjugate>& statements,
                           const BlurFitSetup& setup, const BlurFitResult& fit,
                           Calibration* calibration) {
  if (!calibration->summary.focus_depth_mm) return;
  const Result found = *calibration->summary.focus_depth_mm;
  for (const auto& [other, text] :
       CompareFocus(sweep, statements, {found.value, found.sigma}, *calibration)) {
    calibration->diagnostics.compared_focus.push_back(other);
    if (other.agrees) continue;
    calibration->summary.warnings.push_back(text);
    // The fit at the other depth and its error. Nothing comes into focus nearer than the focal
    // point.
    if (!(other.focus_depth_mm.value > setup.lens.front_focal_length_mm)) continue;
    const double apart_mm = other.focus_depth_mm.value - found.value;
    WidenByTrials(
        fmt::format("contradiction between {} and {}", other.name,
                    calibration->diagnostics.bench_offset_from),
        "find out which of them is wrong, and state the reliable one alone",
        WithOffsets(setup, {setup.offset_mm.value + apart_mm +
                            std::copysign(kReach * other.focus_depth_mm.sigma, apart_mm)}),
        fit, calibration);
  }
}

}  // namespace thicklens::calib
