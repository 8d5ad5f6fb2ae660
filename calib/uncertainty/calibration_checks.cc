#include "calib/uncertainty/calibration_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/registration/radial_causes.h"
#include "calib/registration/scale_tracking.h"
#include "calib/registration/target_period.h"
#include "calib/sweep/frame_selection.h"
#include "calib/uncertainty/systematic_advice.h"

namespace thicklens::calib {
namespace {

// A given bench offset that is off by more than this part of the depth is no error of measurement.
constexpr double kGrossOffset = 0.1;

// m = f1 D/(f2 z) [D5] on the sensor over the target, so D = m z f2/f1.
MagnificationCheck DistanceFromPeriod(const FocusSweep& sweep, const PeriodEstimate& period,
                                      double depth_mm, double offset_sigma_mm) {
  const model::ThickLens& lens = sweep.camera.lens;
  const double rear_mm = period.period_px * sweep.camera.sensor.pixel_pitch_mm /
                         *sweep.target_period_mm * depth_mm * lens.rear_focal_length_mm /
                         lens.front_focal_length_mm;
  MagnificationCheck check;
  check.period_px = period.period_px;
  check.period_mm = *sweep.target_period_mm;
  check.image_distance_mm = {
      lens.lens_thickness_mm + rear_mm,
      rear_mm * std::hypot(period.sigma_px / period.period_px, offset_sigma_mm / depth_mm)};
  return check;
}

}  // namespace

OffsetCheck CheckGivenOffset(const FocusSweep& sweep, const std::string& unit_that_fits,
                             Calibration* calibration) {
  OffsetCheck check;
  const ScaleModel& law = calibration->diagnostics.scale;
  if (!law.done) {
    calibration->summary.warnings.push_back("the given offset_mm could not be checked: " +
                                            law.message);
    return check;
  }
  // No pupil law is known to hold: the zero may lie anywhere in the interval of the laws.
  const double given_mm = sweep.offset_mm->value;
  const double apart_mm =
      std::clamp(given_mm, law.offset_of_pupil_laws_mm.x(), law.offset_of_pupil_laws_mm.y()) -
      given_mm;
  const double sigma_mm = std::hypot(law.offset_mm.sigma, sweep.offset_mm->sigma);
  if (!(std::abs(apart_mm) > 3 * sigma_mm + 1e-3 * law.reference_depth_mm)) return check;
  const std::string found = fmt::format(
      "the image scale puts the bench offset at {:.2f} +- {:.2f} mm, {:+.2f} mm from the given "
      "bench offset",
      given_mm + apart_mm, law.offset_mm.sigma, apart_mm);
  if (std::abs(apart_mm) > kGrossOffset * law.reference_depth_mm &&
      std::abs(apart_mm) > 5 * sigma_mm) {
    check.refusal = found + ": check offset_mm, and that both offset_mm and the readings are in mm";
    if (!unit_that_fits.empty()) *check.refusal += " (" + unit_that_fits + ")";
    return check;
  }
  calibration->summary.warnings.push_back(found);
  check.conflicting_mm = model::Estimate{given_mm + apart_mm, law.offset_mm.sigma};
  return check;
}

std::optional<ScaleNonlinearity> CheckScaleNonlinearity(const FocusSweep& sweep,
                                                        const std::vector<ScaleSample>& scales,
                                                        Calibration* calibration) {
  const std::optional<ScaleNonlinearity> nonlinearity =
      FindScaleNonlinearity(scales, calibration->diagnostics.scale, sweep);
  if (!nonlinearity) return std::nullopt;
  calibration->summary.warnings.push_back(NonlinearityText(*nonlinearity, *calibration));
  return nonlinearity;
}

void WarnOfReadingStep(const FocusSweep& sweep, const ReadingStep& reading_step,
                       Calibration* calibration) {
  const FrameMeasurement& frame = calibration->frames[reading_step.frame];
  const model::Estimate& jump_mm = reading_step.jump_mm;
  std::string jump = fmt::format("{:+.2f} +- {:.2f} mm", jump_mm.value, jump_mm.sigma);
  if (sweep.shown_reading) {
    const double before = sweep.shown_reading(frame.reading_mm - jump_mm.value);
    const double change = sweep.shown_reading(frame.reading_mm) - before;
    jump = fmt::format("{:+.2g} +- {:.1g} {}", change,
                       std::abs(change * jump_mm.sigma / jump_mm.value), sweep.shown_unit);
  }
  calibration->summary.warnings.push_back(
      fmt::format("the readings jump by {} against the image scale from {} (reading {}) on: check "
                  "the clamp and the table of readings there",
                  jump, FileName(frame.image), ReadingInWords(sweep, frame.reading_mm)));
}

std::vector<BlurFitSetup> WithOffsets(const BlurFitSetup& setup,
                                      const std::vector<double>& offsets_mm) {
  std::vector<BlurFitSetup> setups(offsets_mm.size(), setup);
  for (std::size_t i = 0; i < setups.size(); ++i) setups[i].offset_mm.value = offsets_mm[i];
  return setups;
}

std::vector<BlurFitSetup> WithoutReadingStep(const FocusSweep& sweep, const BlurFitSetup& setup,
                                             const ReadingStep& reading_step,
                                             std::vector<ScaleSample> scales, std::size_t reference,
                                             const Calibration& calibration) {
  const double from_mm = calibration.frames[reading_step.frame].reading_mm;
  BlurFitSetup later = setup, earlier = setup;
  for (FitFrame& frame : later.frames) {
    if (frame.reading_mm >= from_mm) frame.reading_mm -= reading_step.jump_mm.value;
  }
  for (FitFrame& frame : earlier.frames) {
    if (frame.reading_mm < from_mm) frame.reading_mm += reading_step.jump_mm.value;
  }
  const std::string& origin = calibration.diagnostics.bench_offset_from;
  if (sweep.offset_mm || (!origin.empty() && origin != kFromScale)) return {later, earlier};
  for (ScaleSample& sample : scales) {
    if (sample.reading_mm >= from_mm) sample.reading_mm -= reading_step.jump_mm.value;
  }
  const ScaleModel law = FitScaleModel(scales, static_cast<int>(reference), setup.reading_sigma_mm,
                                       sweep.direction, RegionCornerRadiusPx(sweep));
  if (!law.done) return {later, earlier};
  later.offset_mm.value = law.offset_mm.value + calibration.diagnostics.scale.centre_mm;
  return {later};
}

BlurFitSetup WithShiftedReadings(const FocusSweep& sweep, const BlurFitSetup& setup,
                                 const std::vector<std::size_t>& frames,
                                 const Eigen::VectorXd& shift_mm, std::vector<ScaleSample> scales,
                                 std::size_t reference, const Calibration& calibration) {
  BlurFitSetup shifted = setup;
  for (std::size_t f = 0; f < frames.size(); ++f)
    shifted.frames[f].reading_mm -= shift_mm[static_cast<Eigen::Index>(frames[f])];
  if (calibration.diagnostics.bench_offset_from != kFromScale) return shifted;
  for (ScaleSample& sample : scales)
    sample.reading_mm -= shift_mm[static_cast<Eigen::Index>(sample.frame)];
  const ScaleModel law = FitScaleModel(scales, static_cast<int>(reference), setup.reading_sigma_mm,
                                       sweep.direction, RegionCornerRadiusPx(sweep));
  if (law.done)
    shifted.offset_mm.value = law.offset_mm.value + calibration.diagnostics.scale.centre_mm;
  return shifted;
}

void CheckMagnification(const FocusSweep& sweep, std::size_t reference, const cv::Mat& grey,
                        Calibration* calibration) {
  if (!calibration->summary.image_distance_mm) return;
  const std::optional<PeriodEstimate> period = MeasurePeriodPx(grey);
  if (!period) {
    calibration->summary.warnings.emplace_back(
        "target_period_mm is stated, but the sharpest frame shows no periodic texture to compare "
        "it with");
    return;
  }
  const MagnificationCheck check =
      DistanceFromPeriod(sweep, *period, calibration->frames[reference].depth_mm,
                         calibration->summary.bench_offset_mm->sigma);
  calibration->diagnostics.magnification = check;
  const Result& focus = *calibration->summary.image_distance_mm;
  const double apart_mm = check.image_distance_mm.value - focus.value;
  if (std::abs(apart_mm) > 3 * std::hypot(check.image_distance_mm.sigma, focus.sigma)) {
    calibration->summary.warnings.push_back(
        fmt::format("the image scale of the target puts d1 at {:.4g} +- {:.2g} mm, which differs "
                    "by {:+.1f} % from the value by the focus: focal length, pixel pitch, "
                    "target_period_mm or the readings are wrong by this amount",
                    check.image_distance_mm.value, check.image_distance_mm.sigma,
                    100 * apart_mm / focus.value));
  }
}

}  // namespace thicklens::calib
