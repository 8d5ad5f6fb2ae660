#include "calib/calibrate/focus_solution.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "calib/fit/blur_tails.h"
#include "calib/fit/frame_outliers.h"
#include "calib/fit/known_focus.h"
#include "calib/fit/misfit_causes.h"
#include "calib/registration/scale_causes.h"
#include "calib/registration/spot_moments.h"
#include "calib/sweep/frame_selection.h"
#include "calib/uncertainty/astigmatism.h"
#include "calib/uncertainty/blur_choices.h"
#include "calib/uncertainty/floor_choice.h"
#include "calib/uncertainty/systematic_advice.h"
#include "calib/uncertainty/systematic_parts.h"
#include "thicklens/base/statistics.h"

namespace thicklens::calib {
namespace {

// A frame whose weight in the robust loss is below this is reported.
constexpr double kOutlierWeight = 0.6;
// Above this chi^2 per degree of freedom the law itself is in doubt.
constexpr double kLargeMisfit = 2;
// Above both of these no blur law and no shape of the blur describes the frames.
constexpr double kDoubtfulChi2 = 5, kDoubtfulShape = 10;
constexpr double kSmallestRatio = 0.2, kLargestRatio = 0.8;
// A lens with a ratio beyond these is unusual: the full aperture gives 0.5 by second moment.
constexpr double kLowRatio = 0.35, kHighRatio = 0.65;
// The window of the points is corrected for a blur of the stated shape. A Gaussian has 0.3 % of its
// second moment beyond it, and a disc nothing [D168].
void WidenByWindow(model::Psf psf, Calibration* calibration) {
  if (!calibration->summary.blur_ratio) return;
  constexpr double kReach2 = SpotWindow::kRadius * SpotWindow::kRadius;
  const double move =
      0.5 * calibration->summary.blur_ratio->value * (1 + kReach2 / 2) * std::exp(-kReach2 / 2);
  WidenRatio("window of the points",
             psf == model::Psf::kGaussian ? Eigen::Vector2d(-move, 0) : Eigen::Vector2d(0, move),
             "state psf: disc if the images of the points are discs", calibration);
}

class Solution {
 public:
  Solution(const FocusSweep& sweep, const FocusMotion* motion, BlurEvidence* evidence,
           BlurFitResult* fit, Calibration* calibration)
      : sweep_(sweep), motion_(motion), evidence_(*evidence), fit_(*fit), result_(*calibration) {}

  void Run() {
    result_.diagnostics.target.spots = evidence_.spots;
    if (evidence_.setup.estimators.empty()) return Refuse(evidence_.message);
    TakeMeanOfAxes(sweep_, &evidence_);
    if (const auto reason = RejectOutliers(sweep_, &evidence_, &result_)) return Refuse(*reason);
    CompareChoices(sweep_.camera.psf, &evidence_);
    const FloorChoice choice =
        ChooseFloor(sweep_.floor, evidence_, &result_.summary.warnings, sweep_.sensor_px_per_px);
    evidence_.setup.floor_variance_px2 = choice.variance_px2;
    fit_ = FitBlurWith(evidence_.setup, evidence_.known_focus);
    if (fit_.done && TakeTails(sweep_.camera.psf, fit_, &evidence_))
      fit_ = FitBlurWith(evidence_.setup, evidence_.known_focus);
    result_.diagnostics.blur.message = fit_.message;
    if (!fit_.done) return Refuse(fit_.message + StatedFloor());
    if (evidence_.known_focus) TakeFittedOffset();
    FillBlur();
    FillFrames();
    FillValues();
    if (!IsPlausible()) return;
    WarnOfMisfit();
    FitSides(evidence_, fit_, &result_);
    AddSystematicParts(sweep_, evidence_, fit_, choice.interval_px2, &result_);
    if (evidence_.by_points) WidenByWindow(sweep_.camera.psf, &result_);
    if (IsDoubtful()) WidenByDoubt();
    if (evidence_.axial) MeasureAstigmatism(sweep_, evidence_, fit_, &result_);
    FillFloor(choice);
    FillCovariance();
    NameUnused();
    Decide();
  }

 private:
  void Refuse(const std::string& reason) {
    result_.summary.outcome = Outcome::kRefused;
    result_.summary.reason = reason;
    if (result_.diagnostics.scale.kind == ScaleKind::kConstant)
      result_.summary.reason += "; " + result_.diagnostics.scale.message;
    result_.diagnostics.magnification_at_focus.reset();
    result_.summary.image_distance_mm.reset();
    result_.summary.focus_depth_mm.reset();
    result_.summary.blur_ratio.reset();
    result_.summary.blur_floor_px.reset();
  }

  // A stated floor that is too large leaves none of the blur, whatever else may be wrong.
  std::string StatedFloor() const {
    if (!sweep_.floor.given_px) return "";
    return fmt::format(" (blur_floor_px is stated as {:.3g}, which may be too large)",
                       sweep_.sensor_px_per_px * sweep_.floor.given_px->value);
  }

  // Places the frames by the bench offset at which the fitted focus is the known one.
  void TakeFittedOffset() {
    model::Estimate& offset_mm = evidence_.setup.offset_mm;
    offset_mm = {fit_.values[kBenchOffset], std::sqrt(fit_.covariance(kBenchOffset, kBenchOffset))};
    result_.summary.bench_offset_mm = Result{offset_mm.value, offset_mm.sigma, std::nullopt};
    const double sign = model::DirectionSign(sweep_.direction);
    for (FrameMeasurement& frame : result_.frames)
      frame.depth_mm = offset_mm.value + sign * frame.reading_mm;
  }

  FrameMeasurement& Frame(std::size_t fit_frame) {
    return result_.frames[evidence_.frames[fit_frame]];
  }
  double DepthMm(std::size_t fit_frame) { return Frame(fit_frame).depth_mm; }

  // The smallest and the largest depth of the frames that are not rejected.
  std::pair<double, double> DepthRange() {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (std::size_t f = 0; f < evidence_.frames.size(); ++f) {
      if (!Frame(f).rejection.empty()) continue;
      low = std::min(low, DepthMm(f));
      high = std::max(high, DepthMm(f));
    }
    return {low, high};
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

  // ---- results ----
  void FillBlur() {
    BlurFit& blur = result_.diagnostics.blur;
    blur.done = true;
    blur.chi2_per_dof = fit_.chi2_per_dof;
    blur.weak_direction = fit_.weak_direction;
    blur.weak_correlation = fit_.weak_correlation;
    blur.estimator = evidence_.by_points      ? "points"
                     : evidence_.edges < 0    ? "relative spectrum"
                     : evidence_.spectrum < 0 ? "edges"
                                              : "edges and relative spectrum";
    TargetFinding& target = result_.diagnostics.target;
    target.measured_as = evidence_.by_points      ? "points"
                         : evidence_.edges < 0    ? "texture"
                         : evidence_.spectrum < 0 ? "edges"
                                                  : "edges and texture";
    blur.family = sweep_.camera.psf;
    blur.tails = evidence_.taken_tails;
    blur.astigmatic_blur_px =
        fit_.values[kBlurRatio] *
        std::sqrt(AstigmaticVariance(evidence_.setup, fit_.values[kFocusDepth]));
    if (evidence_.spectrum >= 0) blur.band = UsualBand(sweep_.camera.psf);
    blur.better_psf = evidence_.disc_misfit ? evidence_.better_psf : sweep_.camera.psf;
    blur.gaussian_misfit = evidence_.gaussian_misfit;
    blur.disc_misfit = evidence_.disc_misfit;
    result_.examples = evidence_.examples;
  }

  void WarnOfMisfit() {
    if (!(fit_.chi2_per_dof > kLargeMisfit) || !(fit_.error_factor > 1)) return;
    result_.summary.warnings.push_back(
        fmt::format("the frames deviate from the blur law by more than their errors (chi2/dof "
                    "{:.3g}), which were widened accordingly: {}",
                    fit_.chi2_per_dof, CausesOfMisfit(sweep_, evidence_, result_)));
  }

  // Whether neither the law nor either shape of the blur describes the frames. The errors were
  // widened by the scatter of the frames about the law, but what moves all frames of a part of the
  // sweep alike does not scatter.
  bool IsDoubtful() const {
    return fit_.error_factor > 1 && fit_.chi2_per_dof > kDoubtfulChi2 &&
           evidence_.gaussian_misfit && evidence_.disc_misfit &&
           std::min(*evidence_.gaussian_misfit, *evidence_.disc_misfit) > kDoubtfulShape;
  }

  std::string Doubt() const {
    return fmt::format(
        "the frames deviate from the blur law (chi2/dof {:.3g}), and their texture deviates from "
        "that of any shape of the blur (chi2/dof {:.3g})",
        fit_.chi2_per_dof, std::min(*evidence_.gaussian_misfit, *evidence_.disc_misfit));
  }

  // Each side of focus alone contradicts the law of both by as much as the law may be wrong, in
  // either direction.
  void WidenByDoubt() {
    double focus_mm = 0, ratio = 0;
    if (!result_.diagnostics.nearer.done && !result_.diagnostics.farther.done) {
      // Neither side can be fitted alone: two of the errors, which the misfit widened, stand for
      // it.
      focus_mm = 2 * std::sqrt(fit_.covariance(kFocusDepth, kFocusDepth));
      ratio = 2 * std::sqrt(fit_.covariance(kBlurRatio, kBlurRatio));
    }
    for (const SideFit* side : {&result_.diagnostics.nearer, &result_.diagnostics.farther}) {
      if (!side->done) continue;
      focus_mm =
          std::max(focus_mm, std::abs(side->focus_depth_mm.value - fit_.values[kFocusDepth]));
      ratio = std::max(ratio, std::abs(side->blur_ratio.value - fit_.values[kBlurRatio]));
    }
    WidenFocusAndRatio("deviation from the blur law", {-focus_mm, focus_mm}, {-ratio, ratio},
                       "find the cause of the deviation and take the sweep again",
                       evidence_.setup.lens, &result_);
  }

  void FillFrames() {
    for (std::size_t m = 0; m < evidence_.setup.estimators.size(); ++m) {
      const BlurSamples& estimator = evidence_.setup.estimators[m];
      for (std::size_t i = 0; i < estimator.frames.size(); ++i) {
        const std::size_t f = estimator.frames[i];
        FrameMeasurement& frame = Frame(f);
        const auto row = static_cast<Eigen::Index>(i);
        const double s2 = std::pow(evidence_.setup.frames[f].scale, 2);
        const double variance =
            std::max(0.0, (estimator.variances_px2[row] - fit_.softness_px2[m]) * s2);
        const double error = std::sqrt(std::max(0.0, estimator.covariance(row, row))) * s2;
        frame.blur_sigma_px = std::sqrt(variance);
        // Near 0 the derivative of the root grows without bound; the root of the variance's error
        // limits it.
        frame.blur_sigma_error_px =
            std::min(error / (2 * std::max(frame.blur_sigma_px, 1e-9)), std::sqrt(error));
        frame.in_blur_fit = true;
      }
    }
    std::vector<std::size_t> light;
    for (std::size_t f = 0; f < evidence_.frames.size(); ++f) {
      FrameMeasurement& frame = Frame(f);
      if (!frame.in_blur_fit) continue;
      const auto row = static_cast<Eigen::Index>(f);
      frame.blur_fit_weight = fit_.weights[row];
      frame.reading_error_mm = fit_.reading_errors_mm[row];
      frame.reading_error_sigma_mm = fit_.reading_error_sigmas_mm[row];
      ++result_.diagnostics.blur.frames_used;
      if (frame.blur_fit_weight < kOutlierWeight) light.push_back(f);
    }
    WarnOfLight(light);
  }

  void WarnOfLight(const std::vector<std::size_t>& light) {
    if (light.empty()) return;
    std::string names;
    for (std::size_t i = 0; i < std::min<std::size_t>(light.size(), 3); ++i) {
      const FrameMeasurement& frame = Frame(light[i]);
      // Readings that are stated to be exact have no error to report.
      const std::string why =
          evidence_.setup.reading_sigma_mm > 0
              ? fmt::format("off by {} or damaged",
                            ReadingErrorInWords(sweep_, frame.reading_mm,
                                                frame.reading_mm - frame.reading_error_mm, 2))
              : std::string("damaged, or its reading is not exact");
      names += fmt::format("{}{} (reading {}, {})", i == 0 ? "" : ", ",
                           std::filesystem::path(frame.image).filename().string(),
                           ReadingInWords(sweep_, frame.reading_mm + frame.stage_error_mm), why);
    }
    if (light.size() > 3) names += fmt::format(" and {} more", light.size() - 3);
    result_.summary.warnings.push_back(
        fmt::format("{} of {} frames do not follow the laws well and have less weight: {}",
                    light.size(), result_.diagnostics.blur.frames_used, names));
  }

  void FillValues() {
    const double zf = fit_.values[kFocusDepth];
    const model::ThickLens& lens = evidence_.setup.lens;
    result_.summary.focus_depth_mm =
        Result{zf, std::sqrt(fit_.covariance(kFocusDepth, kFocusDepth)), std::nullopt};
    result_.summary.blur_ratio = Result{
        fit_.values[kBlurRatio], std::sqrt(fit_.covariance(kBlurRatio, kBlurRatio)), std::nullopt};
    const model::Estimate& zero_mm = evidence_.setup.offset_mm;
    at_held_zero_ = fit_;
    if (zero_mm.sigma > 0) {
      BlurFitSetup held = evidence_.setup;
      held.offset_mm.sigma = 0;
      const BlurFitResult alone = FitBlur(held, &fit_);
      if (alone.done) at_held_zero_ = alone;
    }
    result_.diagnostics.focus_reading_mm =
        model::Estimate{model::DirectionSign(sweep_.direction) * (zf - zero_mm.value),
                        std::sqrt(at_held_zero_.covariance(kFocusDepth, kFocusDepth))};
    FillSlope();
    result_.diagnostics.magnification_at_focus =
        model::Estimate{model::MagnificationAtFocus(lens, zf),
                        lens.front_focal_length_mm * result_.summary.focus_depth_mm->sigma /
                            std::pow(zf - lens.front_focal_length_mm, 2)};
    result_.summary.image_distance_mm = Result{
        model::ImageDistanceMm(lens, zf),
        std::abs(model::ImageDistanceSlope(lens, zf)) * result_.summary.focus_depth_mm->sigma,
        std::nullopt};
  }

  // d sigma/dz of the law far from the floor: kappa (r/p) K/zf^2 [D131], the same for both laws.
  void FillSlope() {
    const double zf = fit_.values[kFocusDepth];
    const model::ThickLens& lens = evidence_.setup.lens;
    const double by_ratio = lens.aperture_radius_mm / evidence_.setup.pixel_pitch_mm *
                            lens.front_focal_length_mm / (zf * (zf - lens.front_focal_length_mm));
    result_.diagnostics.blur_slope_px_per_mm =
        model::Estimate{by_ratio * at_held_zero_.values[kBlurRatio],
                        by_ratio * std::sqrt(at_held_zero_.covariance(kBlurRatio, kBlurRatio))};
  }

  void ForgetFocus() {
    result_.diagnostics.focus_reading_mm.reset();
    result_.diagnostics.blur_slope_px_per_mm.reset();
  }

  // A depth as it is, or the reading of the lens or the sensor that has it.
  std::string Shown(double depth_mm) const {
    return ReadingInWords(sweep_, depth_mm - evidence_.setup.offset_mm.value);
  }
  // A range of depths, or of the readings that have them, the smaller first.
  std::string ShownRange(double nearest_mm, double farthest_mm) const {
    if (motion_ == nullptr) return fmt::format("{:.1f} to {:.1f} mm", nearest_mm, farthest_mm);
    return fmt::format("readings {} to {}", Shown(nearest_mm), Shown(farthest_mm));
  }
  // The error of a depth, or that of the reading that has it.
  std::string ShownError(double depth_mm, double error_mm) const {
    if (motion_ == nullptr) return fmt::format("{:.2g} mm", error_mm);
    const double reading_mm = depth_mm - evidence_.setup.offset_mm.value;
    std::string words = ReadingErrorInWords(sweep_, reading_mm + error_mm, reading_mm, 2);
    return words.front() == '-' ? words.substr(1) : words;
  }
  // A depth beyond the sweep in words, or the reading that has it.
  std::string ShownDepth(double depth_mm) const {
    return motion_ == nullptr ? fmt::format("{:.0f} mm", depth_mm) : "reading " + Shown(depth_mm);
  }

  bool IsPlausible() {
    const double zf = fit_.values[kFocusDepth];
    const double kappa = fit_.values[kBlurRatio];
    const double zf_sigma = result_.summary.focus_depth_mm->sigma;
    const double kappa_sigma = result_.summary.blur_ratio->sigma;
    const auto [nearest, farthest] = DepthRange();
    const double outside_mm = std::max({0.0, nearest - zf, zf - farthest});
    const char* side = zf < nearest ? "nearer" : "farther";
    // These errors are from the blur alone, with the bench offset held.
    const double own_kappa_sigma = std::sqrt(at_held_zero_.covariance(kBlurRatio, kBlurRatio));
    const double own_zf_sigma = result_.diagnostics.focus_reading_mm->sigma;
    if (!(kappa > 3 * own_kappa_sigma)) {
      ForgetFocus();
      Refuse(fmt::format(
          "the blur does not change over the sweep by more than its errors, for any bench offset "
          "(kappa would be {:.2g} +- {:.2g}): move {} farther from focus on both sides",
          kappa, own_kappa_sigma,
          motion_ == nullptr ? "the target" : "the " + model::SweepMotionName(*sweep_.moves)));
      return false;
    }
    if (!(own_zf_sigma < 0.5 * (farthest - nearest))) {
      ForgetFocus();
      Refuse(
          motion_ == nullptr
              ? fmt::format("the blur does not determine the in-focus object distance: {:.1f} +- "
                            "{:.1f} mm in a "
                            "sweep from {:.1f} to {:.1f} mm, with the bench offset held fixed",
                            zf, own_zf_sigma, nearest, farthest)
              : fmt::format(
                    "the blur does not determine the reading at focus: {} +- {} in a sweep of {}",
                    Shown(zf), ShownError(zf, own_zf_sigma), ShownRange(nearest, farthest)));
      return false;
    }
    if (evidence_.zero_is_open) {
      Refuse(ReasonOfOpenZero());
      return false;
    }
    // The error of the bench offset has nothing to do with the length of the sweep: it matters
    // against the distance from the focal point, where d1 and kappa become infinite.
    const double beyond_mm = zf - evidence_.setup.lens.front_focal_length_mm;
    if (!(zf_sigma < beyond_mm / kKnownSigmas) || !(kappa > kKnownSigmas * kappa_sigma)) {
      Refuse(ReasonOfZero(nearest, farthest));
      return false;
    }
    if (outside_mm > 0 && !(own_zf_sigma < StepMm())) {
      Refuse(
          fmt::format("sharpness is monotone: the focus lies {} the sweep ({}), at about {} +- "
                      "{}; extend the sweep in this direction",
                      motion_ == nullptr ? std::string(side) + " than" : "outside",
                      ShownRange(nearest, farthest), ShownDepth(zf),
                      ShownError(zf, std::max(zf_sigma, own_zf_sigma))));
      return false;
    }
    // An uncertain bench offset makes the ratio uncertain, which is then no contradiction.
    const double reach = kKnownSigmas * kappa_sigma;
    if (!(kappa + reach >= kSmallestRatio && kappa - reach <= kLargestRatio)) {
      // Numbers of the camera change the ratio, and not how well the frames follow the law.
      if (IsDoubtful()) {
        Refuse(fmt::format("{}; the blur ratio would be {:.{}f}, which no lens has ({} to {}): {}",
                           Doubt(), kappa, kappa < 0.1 ? 4 : 2, kSmallestRatio, kLargestRatio,
                           CausesOfMisfit(sweep_, evidence_, result_)));
        return false;
      }
      Refuse(
          fmt::format("the blur ratio would have to be {:.{}f}, which no lens has ({} to {}): "
                      "check {}the unit of the readings, and that the {} moved and not {}",
                      kappa, kappa < 0.1 ? 4 : 2, kSmallestRatio, kLargestRatio, NumbersOfRatio(),
                      motion_ == nullptr ? "target" : model::SweepMotionName(*sweep_.moves),
                      motion_ == nullptr ? "the lens" : "the target"));
      return false;
    }
    if (!(kappa + reach >= kLowRatio && kappa - reach <= kHighRatio)) {
      result_.summary.warnings.push_back(
          fmt::format("a blur ratio of {:.3f} is unusual (the full aperture gives 0.5): a wrong "
                      "focal length, aperture radius or pixel pitch has this effect; photograph a "
                      "grid and state its target_period_mm to check them",
                      kappa));
    }
    result_.diagnostics.blur.outside_mm = outside_mm;
    if (outside_mm > 0) {
      result_.summary.warnings.push_back(
          motion_ == nullptr
              ? fmt::format(
                    "the focus at {:.2f} mm is extrapolated: it lies {:.2f} mm {} than the sweep",
                    zf, outside_mm, side)
              : fmt::format("the focus at reading {} is extrapolated: it lies outside the "
                            "sweep ({})",
                            Shown(zf), ShownRange(nearest, farthest)));
    }
    return true;
  }

  // The numbers by which the growth of the blur gives its ratio. Those of an objective include its
  // magnification, to which the ratio is in inverse proportion.
  std::string NumbersOfRatio() const {
    const auto& known = evidence_.known_focus;
    if (sweep_.camera.objective && known && known->kind == model::ConjugateKind::kMagnification) {
      const double magnification = known->value.value;
      return fmt::format(
          "{} ({:.4g}; with lens.numerical_aperture {:.3g} the blur fits about {:.2g}), "
          "lens.tube_lens_focal_length_mm, lens.numerical_aperture, pixel pitch, ",
          known->name, magnification, sweep_.camera.objective->numerical_aperture,
          MagnificationOfBlur(*sweep_.camera.objective, evidence_.setup.pixel_pitch_mm,
                              result_.diagnostics.blur_slope_px_per_mm->value));
    }
    return "focal lengths, aperture radius, pixel pitch, " +
           (known ? known->name + ", " : std::string());
  }

  std::string KnownReading() const {
    const model::Estimate& slope = *result_.diagnostics.blur_slope_px_per_mm;
    return fmt::format(
        "The reading at focus is known ({:.6g} +- {:.2g} mm), and so is the growth of the blur "
        "(sigma {:.4g} +- {:.2g} px per mm of reading)",
        motion_ == nullptr
            ? result_.diagnostics.focus_reading_mm->value
            : motion_->ReadingAt(result_.diagnostics.focus_reading_mm->value).value_or(0),
        result_.diagnostics.focus_reading_mm->sigma, sweep_.sensor_px_per_px * slope.value,
        sweep_.sensor_px_per_px * slope.sigma);
  }

  // The advice where the image scale does not determine the bench offset.
  static constexpr char kStateOne[] =
      "State one of: target_period_mm (with a grid or ruler of that period in view), "
      "magnification, image_distance_mm, optical_tube_length_mm, working_distance_mm, "
      "focus_depth_mm or offset_mm; or, in the camera file, a microscope's lens.magnification";

  std::string ReasonOfOpenZero() const {
    const ScaleModel& scale = result_.diagnostics.scale;
    // The message of a constant scale is appended to every refusal.
    const std::string why = scale.kind == ScaleKind::kConstant ? "the image scale does not change"
                            : scale.done
                                ? fmt::format(
                                      "the sweep is too short for its image scale to determine the "
                                      "bench offset ({:.4g} +- {:.2g} mm)",
                                      scale.offset_mm.value, scale.offset_mm.sigma)
                                : scale.message;
    return fmt::format(
        "nothing determines the distance of the target, on which zf, d1 and kappa depend: {}. {}. "
        "{}",
        why, KnownReading(), kStateOne);
  }

  // The reason where the blur determines the reading at focus, but the bench offset does not
  // determine the depths of the sweep.
  std::string ReasonOfZero(double nearest_mm, double farthest_mm) const {
    const model::Estimate& zero_mm = evidence_.setup.offset_mm;
    const std::string& origin = result_.diagnostics.bench_offset_from;
    if (motion_ != nullptr) {
      return fmt::format(
          "the distance from the lens to the sensor is not known well enough: by {} it is {:.4g} "
          "+- {:.2g} mm at focus with a focal length of {:.4g} mm. {}. State one of: "
          "focus_depth_mm, magnification, image_distance_mm or offset_mm (d1 at reading 0)",
          origin, motion_->SensorDistanceAtFocusMm(), result_.summary.focus_depth_mm->sigma,
          sweep_.camera.lens.front_focal_length_mm, KnownReading());
    }
    const std::string from =
        origin == kFromScale
            ? fmt::format(
                  "the sweep is {:.3g} mm long at a depth of {:.4g} mm, too short for its image "
                  "scale to determine the bench offset ({:.4g} +- {:.2g} mm)",
                  farthest_mm - nearest_mm, fit_.values[kFocusDepth], zero_mm.value, zero_mm.sigma)
            : fmt::format("by {} it is {:.4g} +- {:.2g} mm", origin, zero_mm.value, zero_mm.sigma);
    return fmt::format(
        "the bench offset is not known well enough: {}, so that the in-focus object distance is "
        "{:.1f} +- "
        "{:.1f} mm with a focal length of {:.4g} mm. {}. {}",
        from, fit_.values[kFocusDepth], result_.summary.focus_depth_mm->sigma,
        evidence_.setup.lens.front_focal_length_mm, KnownReading(),
        origin == kFromScale ? std::string(kStateOne)
                             : fmt::format("State {} more exactly", origin));
  }

  void FillFloor(const FloorChoice& choice) {
    const double floor_px2 = fit_.values[kFloorVariance];
    const double error_px2 = std::sqrt(fit_.covariance(kFloorVariance, kFloorVariance));
    if (choice.interval_px2) {
      // Only the interval is known; any value in it would be arbitrary.
      constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
      result_.summary.blur_floor_px =
          Result{kUnknown, kUnknown, Eigen::Vector2d(choice.interval_px2->cwiseSqrt())};
      result_.diagnostics.blur.undetermined.emplace_back("blur_floor_px");
    } else if (floor_px2 > error_px2 || !choice.is_measured) {
      const double floor_px = std::sqrt(std::max(0.0, floor_px2));
      result_.summary.blur_floor_px =
          Result{floor_px, floor_px > 0 ? error_px2 / (2 * floor_px) : 0, std::nullopt};
    } else {
      result_.diagnostics.blur.undetermined.emplace_back("blur_floor_px");
    }
  }

  // Converts the covariance from (zf, kappa, S0, offset) to the parameters of the camera file. An
  // undetermined floor has no row.
  void FillCovariance() {
    std::vector<int> rows = {kFocusDepth, kBlurRatio};
    result_.diagnostics.covariance_order = {"image_distance_mm", "blur_ratio"};
    Eigen::Vector4d slope(model::ImageDistanceSlope(evidence_.setup.lens, fit_.values[kFocusDepth]),
                          1, 0, 1);
    const bool floor_is_open = !result_.diagnostics.blur.undetermined.empty();
    Eigen::Matrix4d covariance = fit_.covariance;
    const double offset_sigma = evidence_.setup.offset_mm.sigma;
    covariance(kBenchOffset, kBenchOffset) =
        std::max(covariance(kBenchOffset, kBenchOffset), offset_sigma * offset_sigma);
    if (!floor_is_open) {
      rows.push_back(kFloorVariance);
      result_.diagnostics.covariance_order.emplace_back("blur_floor_px");
      const double floor_px = std::sqrt(std::max(0.0, fit_.values[kFloorVariance]));
      slope[kFloorVariance] = floor_px > 0 ? 1 / (2 * floor_px) : 0;
    }
    rows.push_back(kBenchOffset);
    result_.diagnostics.covariance_order.emplace_back("bench_offset_mm");
    const Eigen::Matrix4d full = slope.asDiagonal() * covariance * slope.asDiagonal();
    result_.diagnostics.covariance = full(rows, rows);
  }

  // Reports the frames that passed every quality check and still do not constrain the blur.
  void NameUnused() {
    for (std::size_t f = 0; f < evidence_.frames.size(); ++f) {
      FrameMeasurement& frame = Frame(f);
      if (frame.in_blur_fit || !frame.rejection.empty()) continue;
      if (evidence_.axial &&
          std::find(evidence_.axial->thinned_out.begin(), evidence_.axial->thinned_out.end(), f) !=
              evidence_.axial->thinned_out.end()) {
        frame.not_in_fit =
            "the lens is astigmatic, and the blur along x and along y of so many frames is fitted "
            "to evenly spread ones alone";
        continue;
      }
      if (evidence_.by_points) {
        frame.not_in_fit = evidence_.without_points[evidence_.frames[f]];
        continue;
      }
      frame.not_in_fit = frame.image_scale
                             ? "it is blurred too strongly, or its scale differs too much, for the "
                               "part of the target that all frames share"
                             : "it could not be registered and shows no edges";
    }
  }

  void Decide() {
    result_.summary.outcome = Outcome::kOk;
    result_.summary.reason.clear();
    if (!result_.diagnostics.blur.undetermined.empty()) {
      result_.summary.outcome = Outcome::kPartial;
      result_.summary.reason = "the blur floor is not determined";
    }
    if (IsDoubtful()) {
      std::string& reason = result_.summary.reason;
      if (!reason.empty()) reason += "; ";
      reason += "the result is doubtful: " + Doubt();
      result_.summary.outcome = Outcome::kPartial;
    }
  }

  const FocusSweep& sweep_;
  const FocusMotion* motion_;
  BlurEvidence& evidence_;
  BlurFitResult& fit_;
  BlurFitResult at_held_zero_;  // the same fit; its errors exclude the bench offset's
  Calibration& result_;
};

}  // namespace

void SolveFocus(const FocusSweep& sweep, BlurEvidence* evidence, BlurFitResult* fit,
                Calibration* calibration, const FocusMotion* motion) {
  Solution(sweep, motion, evidence, fit, calibration).Run();
}

}  // namespace thicklens::calib
