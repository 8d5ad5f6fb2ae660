#include "calib/calibrate/counted_focus.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "calib/calibrate/zero_choice.h"
#include "calib/fit/blur_measurement.h"
#include "calib/fit/known_focus.h"
#include "calib/registration/moving_scale.h"
#include "thicklens/model/pupil_law.h"

namespace thicklens::calib {
namespace {

constexpr char kSteps[] = "steps";
constexpr double kKnownLength = 3;  // standard deviations of a length that is used

std::vector<model::StatedConjugate> Statements(const FocusSweep& sweep,
                                               const SweepPreview& preview) {
  std::vector<model::StatedConjugate> statements = sweep.stated_focus;
  if (!sweep.target_period_mm) return statements;
  const cv::Mat grey = LinearGrey(sweep.read_frame(preview.reference), sweep, preview.reference);
  if (const auto measured = MagnificationOfPeriod(sweep, grey, 0)) statements.push_back(*measured);
  return statements;
}

model::Estimate CountAtFocus(const SweepPreview& preview) {
  const SharpestReading& sharpest = preview.found.diagnostics.sharpest;
  if (sharpest.done) return sharpest.reading_mm;
  return {preview.found.frames[preview.reference].reading_mm, 0};
}

// Change of ln(scale) per count. For the fit of the scale's law the counts have a length at which
// the sweep is short against the focal length.
model::Estimate SlopePerCount(std::vector<ScaleSample> samples, const model::ThickLens& lens,
                              model::SweepMotion moves, double sign) {
  constexpr double kShort = 0.01;  // of the focal length
  if (samples.empty()) return {};
  const auto [low, high] = std::minmax_element(
      samples.begin(), samples.end(),
      [](const ScaleSample& a, const ScaleSample& b) { return a.reading_mm < b.reading_mm; });
  const double range = high->reading_mm - low->reading_mm, middle = low->reading_mm + 0.5 * range;
  if (!(range > 0)) return {};
  const double length_mm = kShort * lens.rear_focal_length_mm / range;
  for (ScaleSample& sample : samples) sample.reading_mm = length_mm * (sample.reading_mm - middle);
  const model::Estimate slope = FitMovingScale(samples, lens, moves, sign, 0, 0).slope_per_mm;
  return {length_mm * slope.value, length_mm * slope.sigma};
}

// The growth of the image per mm over that without the shift of a point's mean ray, which the laws
// of the light over the pupil give [D138]: 1 - A mu. The error covers all laws.
model::Estimate GrowthByMeanRay(const FocusSweep& sweep, const FocusMotion& motion) {
  std::vector<double> factors;
  double of_paper = 1;
  for (const model::PupilLaw pupil : model::AllPupilLaws()) {
    const double centre_mm = motion.EquivalentCentreMm(model::CentreOfPerspectiveMm(
        sweep.camera.lens, sweep.camera.psf, pupil, kDefaultRatio, motion.FocusDepthMm()));
    factors.push_back(1 / (1 - centre_mm / motion.unit_mm()));
    if (pupil == model::PupilLaw::kPaper) of_paper = factors.back();
  }
  const auto [least, most] = std::minmax_element(factors.begin(), factors.end());
  return {of_paper, 0.5 * (*most - *least)};
}

Calibration Refused(Calibration found, model::SweepMotion moves, const std::string& reason) {
  found.summary.outcome = Outcome::kRefused;
  found.summary.reason = reason;
  found.diagnostics.moves = moves;
  found.diagnostics.step_length_mm = model::Estimate{0, std::numeric_limits<double>::infinity()};
  return found;
}

std::string ReasonOfUnknownLength(const model::Estimate& focus, const model::Estimate& slope) {
  return fmt::format(
      "the length of a step is not known, on which d1 and kappa depend. Known are the count at "
      "focus, {:.6g} +- {:.2g}, and that the image grows by {:.3g} +- {:.1g} % per 1000 steps. "
      "State the length of a step (--reading-scale, readings_scale_mm), or one of focus_depth_mm, "
      "working_distance_mm, image_distance_mm (at the count at focus), magnification or "
      "target_period_mm, with which the image scale gives it",
      focus.value, focus.sigma, 1e5 * std::abs(slope.value), 1e5 * slope.sigma);
}

// The results in counts. The depths, distances and ratios stay.
void ToCounts(const model::Estimate& length_mm, double sign, const FocusSweep& sweep,
              Calibration* found) {
  const double g = length_mm.value;
  CalibrationDiagnostics& diagnostics = found->diagnostics;
  for (std::size_t i = 0; i < found->frames.size(); ++i) {
    FrameMeasurement& frame = found->frames[i];
    frame.reading_mm = sweep.frames[i].reading_mm;
    frame.reading_error_mm /= g;
    frame.reading_error_sigma_mm /= g;
    frame.stage_error_mm /= g;
    frame.depth_per_reading *= g;
  }
  const auto to_counts = [g](model::Estimate* estimate) {
    estimate->value /= g;
    estimate->sigma /= g;
  };
  if (diagnostics.sharpest.done) to_counts(&diagnostics.sharpest.reading_mm);
  if (diagnostics.focus_reading_mm) to_counts(&*diagnostics.focus_reading_mm);
  if (diagnostics.blur_slope_px_per_mm) {
    diagnostics.blur_slope_px_per_mm->value *= g;
    diagnostics.blur_slope_px_per_mm->sigma *= g;
  }
  if (diagnostics.focus_positions) {
    diagnostics.focus_positions->unit = kSteps;
    for (auto& position : diagnostics.focus_positions->positions) position.reading /= g;
  }
  diagnostics.scale.reading_rms_mm /= g;
  // kappa is in inverse proportion to the length. d1 at count 0 is far from focus, and has the
  // length's error times the count at focus.
  CalibrationSummary& summary = found->summary;
  const double relative = length_mm.sigma / g;
  if (summary.blur_ratio)
    summary.blur_ratio->sigma =
        std::hypot(summary.blur_ratio->sigma, relative * summary.blur_ratio->value);
  if (summary.bench_offset_mm && diagnostics.focus_reading_mm && summary.image_distance_mm) {
    const double count = diagnostics.focus_reading_mm->value;
    summary.bench_offset_mm->value = summary.image_distance_mm->value - sign * g * count;
    summary.bench_offset_mm->sigma =
        std::hypot(summary.image_distance_mm->sigma, length_mm.sigma * count);
  }
  diagnostics.step_length_mm = length_mm;
}

}  // namespace

Calibration CalibrateCountedFocus(const FocusSweep& sweep, model::SweepMotion moves,
                                  const TargetCalibration& target) {
  SweepPreview preview = target.preview(sweep);
  if (!preview.passed) return Refused(preview.found, moves, preview.found.summary.reason);
  const double sign = model::DirectionSign(sweep.direction);
  const model::ThickLens& lens = sweep.camera.lens;
  const model::Estimate focus = CountAtFocus(preview);
  const model::Estimate slope = SlopePerCount(preview.samples, lens, moves, sign);
  const auto stated = MostPrecise(sweep.camera, Statements(sweep, preview));
  if (!stated) return Refused(preview.found, moves, ReasonOfUnknownLength(focus, slope));
  const model::Estimate depth_mm = FocusDepthWithTolerance(sweep.camera, *stated);
  const double xf_mm = SensorDistanceOf(lens, depth_mm.value);
  model::Estimate length_mm = FitStepLength(preview.samples, lens, moves, focus.value, xf_mm);
  if (!(std::abs(length_mm.value) > kKnownLength * length_mm.sigma)) {
    return Refused(preview.found, moves,
                   fmt::format("the image scale does not show the length of a step: {:.2g} +- "
                               "{:.2g} mm, with {} of the plane of focus. State it "
                               "(--reading-scale, readings_scale_mm), or extend the sweep",
                               length_mm.value, length_mm.sigma, stated->name));
  }
  // The length follows u, which the statement gives, and the law around the count at focus.
  const double change_mm = 1e-4 * xf_mm;
  const double by_xf =
      (FitStepLength(preview.samples, lens, moves, focus.value, xf_mm + change_mm).value -
       length_mm.value) /
      change_mm;
  const double xf_sigma_mm =
      std::abs(model::ImageDistanceSlope(lens, depth_mm.value)) * depth_mm.sigma;
  const model::Estimate growth =
      GrowthByMeanRay(sweep, FocusMotion(sweep, moves, xf_mm, focus.value));
  // The sign is that of the stated direction; CalibrateMovingFocus refuses the other one.
  const double g = std::abs(length_mm.value) / growth.value;
  FocusSweep in_mm = sweep;
  in_mm.readings_are_counts = false;
  in_mm.reading_sigma_mm *= g;
  for (model::SweepFrame& frame : in_mm.frames) frame.reading_mm *= g;
  in_mm.shown_reading = [g](double reading_mm) { return reading_mm / g; };
  in_mm.shown_unit = kSteps;
  Calibration found = CalibrateMovingFocus(in_mm, moves, target);
  length_mm = {g, std::hypot(std::hypot(length_mm.sigma, by_xf * xf_sigma_mm),
                             g * growth.sigma / growth.value)};
  ToCounts(length_mm, sign, sweep, &found);
  return found;
}

}  // namespace thicklens::calib
