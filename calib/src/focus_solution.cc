#include "focus_solution.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "edge_pixels.h"

namespace thicklens::calib {
namespace {

// A lens floor that nobody measured: between a perfect lens and a soft one, px.
constexpr double kUnknownFloorFromPx = 0;
constexpr double kUnknownFloorToPx = 0.7;
// What the meter's own calibration is good for, relative to kappa (docs/calibration.md).
constexpr double kAbsoluteRatioError = 0.015;
constexpr double kRelativeRatioError = 0.05;
// Weight of the robust loss below which a frame is told: six standard deviations off.
constexpr double kOutlierWeight = 0.15;
constexpr std::size_t kFewestOnASide = 8;
constexpr double kSmallestRatio = 0.1, kLargestRatio = 0.8;

// What may be assumed of the variance at focus: a value, or only an interval.
struct FloorChoice {
  std::optional<model::Estimate> variance_px2;  // nothing: fitted freely
  std::optional<Eigen::Vector2d> interval_px2;  // (lo, hi): not known better
  bool target_softness = false;
  bool is_measured = false;  // the fit measures the lens floor itself
};

class Solution {
 public:
  Solution(const FocusSweep& sweep, const std::vector<BlurSample>& samples, bool absolute,
           std::size_t reference, Calibration* calibration)
      : sweep_(sweep), samples_(samples), absolute_(absolute), result_(*calibration) {
    setup_.lens = sweep.camera.lens;
    setup_.pixel_pitch_mm = sweep.camera.sensor.pixel_pitch_mm;
    setup_.offset_mm = {result_.bench_offset_mm->value, result_.bench_offset_mm->sigma};
    setup_.direction = sweep.direction;
    setup_.reading_sigma_mm = sweep.reading_sigma_mm;
    if (sweep.reading_sigma_mm == 0 && result_.scale.done) {
      // Nobody stated it, but the scale law has measured it.
      setup_.reading_sigma_mm = result_.scale.reading_rms_mm;
    }
    setup_.reference_reading_mm = sweep.frames[reference].reading_mm;
    setup_.start_focus_depth_mm = result_.sharpness.done ? result_.sharpness.focus_depth_mm
                                                         : result_.frames[reference].depth_mm;
    setup_.start_focus_depth_mm = std::clamp(setup_.start_focus_depth_mm, Nearest(), Farthest());
  }

  void Run() {
    const FloorChoice choice = ChooseFloor();
    setup_.floor_variance_px2 = choice.variance_px2;
    setup_.target_softness = choice.target_softness;
    const BlurFitResult fit = FitBlur(samples_, setup_);
    result_.blur.message = fit.message;
    if (!fit.done) return Refuse(fit.message);
    result_.blur.done = true;
    result_.blur.chi2_per_dof = fit.chi2_per_dof;
    FillFrames(fit);
    FillValues(fit);
    if (!IsPlausible(fit)) return;
    AddSystematic(choice);
    FillFloor(choice, fit);
    FillCovariance(fit);
    Decide();
  }

 private:
  void Refuse(const std::string& reason) {
    result_.outcome = Outcome::kRefused;
    result_.reason = reason;
    result_.image_distance_mm.reset();
    result_.focus_depth_mm.reset();
    result_.blur_ratio.reset();
    result_.blur_floor_px.reset();
  }

  double Nearest() const {
    return Extreme([](double a, double b) { return std::min(a, b); });
  }
  double Farthest() const {
    return Extreme([](double a, double b) { return std::max(a, b); });
  }
  template <typename Pick>
  double Extreme(const Pick& pick) const {
    double found = 0;
    for (const FrameMeasurement& frame : result_.frames) {
      if (frame.rejection.empty())
        found = found == 0 ? frame.depth_mm : pick(found, frame.depth_mm);
    }
    return found;
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

  // In one sweep the lens floor and the softness of the target are told apart only by what is known
  // of the target: a knife edge has none, a print may have all of it. On a texture the floor cannot
  // be found at all (DESIGN 3.7).
  FloorChoice ChooseFloor() {
    FloorChoice choice;
    const model::FloorKnowledge& known = sweep_.floor;
    const bool knife_edge = absolute_ && sweep_.target == model::SweepTarget::kKnifeEdge;
    choice.target_softness = absolute_ && !knife_edge;
    if (known.given_px) {
      const double floor_px = known.given_px->value;
      choice.variance_px2 =
          model::Estimate{floor_px * floor_px, 2 * floor_px * known.given_px->sigma};
    } else if (knife_edge) {
      choice.is_measured = true;
    } else {
      choice.interval_px2 = UnknownFloor();
      choice.variance_px2 = model::Estimate{choice.interval_px2->mean(), 0};
    }
    return choice;
  }

  Eigen::Vector2d UnknownFloor() {
    const model::FloorKnowledge& known = sweep_.floor;
    if (known.from_px) return {*known.from_px * *known.from_px, *known.to_px * *known.to_px};
    if (absolute_) {
      // From none of the edge's softness to all of it.
      BlurFitSetup free = setup_;
      free.floor_variance_px2.reset();
      free.target_softness = false;
      const BlurFitResult all_lens = FitBlur(samples_, free);
      if (all_lens.done && all_lens.values[2] > 0) {
        result_.warnings.push_back(fmt::format(
            "the edges are {:.2f} px soft at focus; how much of it is the lens and how much the "
            "target is not known: photograph a knife edge, or state blur_floor_px",
            std::sqrt(all_lens.values[2])));
        return {0, all_lens.values[2]};
      }
    }
    result_.warnings.push_back(
        fmt::format("the lens floor cannot be found from this target; {} to {} px is allowed for: "
                    "measure it on a "
                    "knife edge, or state blur_floor_px",
                    kUnknownFloorFromPx, kUnknownFloorToPx));
    return {kUnknownFloorFromPx * kUnknownFloorFromPx, kUnknownFloorToPx * kUnknownFloorToPx};
  }

  void FillFrames(const BlurFitResult& fit) {
    std::vector<std::size_t> outliers;
    for (std::size_t i = 0; i < samples_.size(); ++i) {
      FrameMeasurement& frame = result_.frames[samples_[i].frame];
      frame.in_blur_fit = true;
      frame.blur_fit_weight = fit.weights[i];
      frame.blur_sigma_px = std::sqrt(std::max(0.0, fit.variances_px2[i]));
      // Near 0 the root's derivative grows without bound; the variance's own root bounds the error.
      frame.blur_sigma_error_px =
          std::min(samples_[i].error_px2 / (2 * std::max(frame.blur_sigma_px, 1e-9)),
                   std::sqrt(samples_[i].error_px2));
      if (fit.weights[i] < kOutlierWeight) {
        outliers.push_back(samples_[i].frame);
      } else {
        ++result_.blur.frames_used;
      }
    }
    WarnOfOutliers(outliers);
  }

  void WarnOfOutliers(const std::vector<std::size_t>& outliers) {
    if (outliers.empty()) return;
    std::string names;
    for (std::size_t i = 0; i < std::min<std::size_t>(outliers.size(), 3); ++i) {
      const FrameMeasurement& frame = result_.frames[outliers[i]];
      names +=
          fmt::format("{}{} (reading {} mm)", i == 0 ? "" : ", ",
                      std::filesystem::path(frame.image).filename().string(), frame.reading_mm);
    }
    if (outliers.size() > 3) names += fmt::format(" and {} more", outliers.size() - 3);
    result_.warnings.push_back(fmt::format(
        "{} of {} frames do not follow the blur law (reading off, frame damaged, or a lens "
        "that does not): {}",
        outliers.size(), samples_.size(), names));
  }

  void FillValues(const BlurFitResult& fit) {
    const double zf = fit.values[0];
    result_.focus_depth_mm = Result{zf, std::sqrt(fit.covariance(0, 0)), std::nullopt};
    result_.blur_ratio = Result{fit.values[1], std::sqrt(fit.covariance(1, 1)), std::nullopt};
    result_.image_distance_mm =
        Result{model::ImageDistanceMm(setup_.lens, zf),
               std::abs(model::ImageDistanceSlope(setup_.lens, zf)) * result_.focus_depth_mm->sigma,
               std::nullopt};
  }

  bool IsPlausible(const BlurFitResult& fit) {
    const double zf = fit.values[0];
    const double kappa = fit.values[1];
    const double zf_sigma = result_.focus_depth_mm->sigma;
    const double kappa_sigma = result_.blur_ratio->sigma;
    const double outside_mm = std::max({0.0, Nearest() - zf, zf - Farthest()});
    const char* side = zf < Nearest() ? "nearer" : "farther";
    if (!(kappa > 3 * kappa_sigma)) {
      Refuse(
          fmt::format("the blur does not change over the sweep by more than its errors (blur ratio "
                      "{:.3f} +- {:.3f}): "
                      "move the target farther from focus on both sides",
                      kappa, kappa_sigma));
      return false;
    }
    if (!(zf_sigma < 0.5 * (Farthest() - Nearest()))) {
      Refuse(
          fmt::format("the depth of focus is not fixed by the blur: {:.1f} +- {:.1f} mm in a sweep "
                      "from {:.1f} to {:.1f} mm",
                      zf, zf_sigma, Nearest(), Farthest()));
      return false;
    }
    if (outside_mm > 0 && !(zf_sigma < StepMm())) {
      Refuse(
          fmt::format("sharpness is monotone: the focus lies {} than the sweep ({:.1f} to {:.1f} "
                      "mm), about {:.0f} +- "
                      "{:.0f} mm; extend the sweep that way",
                      side, Nearest(), Farthest(), zf, zf_sigma));
      return false;
    }
    if (!(kappa >= kSmallestRatio && kappa <= kLargestRatio)) {
      Refuse(
          fmt::format("the blur ratio comes out as {:.3f}, which no lens has ({} to {}): check "
                      "focal lengths, aperture "
                      "radius, pixel pitch and the unit of the readings",
                      kappa, kSmallestRatio, kLargestRatio));
      return false;
    }
    if (outside_mm > 0) {
      result_.warnings.push_back(
          fmt::format("the focus at {:.2f} mm is extrapolated: it lies {:.2f} mm {} than the sweep",
                      zf, outside_mm, side));
    }
    return true;
  }

  // The ends of what is not known of the floor, and the meter's own part of kappa.
  void AddSystematic(const FloorChoice& choice) {
    Eigen::Vector2d focus = Eigen::Vector2d::Constant(result_.focus_depth_mm->value);
    Eigen::Vector2d ratio = Eigen::Vector2d::Constant(result_.blur_ratio->value);
    if (choice.interval_px2) {
      for (const double end_px2 : {choice.interval_px2->x(), choice.interval_px2->y()}) {
        BlurFitSetup at_end = setup_;
        at_end.floor_variance_px2 = model::Estimate{end_px2, 0};
        const BlurFitResult fit = FitBlur(samples_, at_end);
        if (!fit.done) continue;
        focus = {std::min(focus.x(), fit.values[0]), std::max(focus.y(), fit.values[0])};
        ratio = {std::min(ratio.x(), fit.values[1]), std::max(ratio.y(), fit.values[1])};
      }
    }
    IncludeSides(&focus, &ratio);
    const Tolerances open = OpenByTolerances();
    focus += Eigen::Vector2d(-open.focus_depth_mm, open.focus_depth_mm);
    ratio += Eigen::Vector2d(-open.blur_ratio, open.blur_ratio);
    const double meter = absolute_ ? kAbsoluteRatioError : kRelativeRatioError;
    result_.blur_ratio->systematic =
        Eigen::Vector2d(ratio.x() * (1 - meter), ratio.y() * (1 + meter));
    result_.focus_depth_mm->systematic = focus;
    // d1 falls as zf grows.
    result_.image_distance_mm->systematic =
        Eigen::Vector2d(model::ImageDistanceMm(setup_.lens, focus.y()) - open.image_distance_mm,
                        model::ImageDistanceMm(setup_.lens, focus.x()) + open.image_distance_mm);
  }

  // What the tolerances stated in the camera file leave open, in quadrature. d1 follows the focal
  // length directly; what comes to it through zf is in the interval of zf.
  struct Tolerances {
    double focus_depth_mm = 0, image_distance_mm = 0, blur_ratio = 0;
  };
  Tolerances OpenByTolerances() const {
    Tolerances open;
    for (const auto& [field, statement] : sweep_.camera.statements) {
      if (!(statement.tolerance > 0)) continue;
      Tolerances largest;
      for (const double change : {-statement.tolerance, statement.tolerance}) {
        BlurFitSetup changed = setup_;
        if (!Change(field, change, &changed)) continue;
        const BlurFitResult fit = FitBlur(samples_, changed);
        if (!fit.done) continue;
        const double zf = result_.focus_depth_mm->value;
        largest.focus_depth_mm = std::max(largest.focus_depth_mm, std::abs(fit.values[0] - zf));
        largest.blur_ratio =
            std::max(largest.blur_ratio, std::abs(fit.values[1] - result_.blur_ratio->value));
        largest.image_distance_mm =
            std::max(largest.image_distance_mm, std::abs(model::ImageDistanceMm(changed.lens, zf) -
                                                         model::ImageDistanceMm(setup_.lens, zf)));
      }
      open.focus_depth_mm = std::hypot(open.focus_depth_mm, largest.focus_depth_mm);
      open.image_distance_mm = std::hypot(open.image_distance_mm, largest.image_distance_mm);
      open.blur_ratio = std::hypot(open.blur_ratio, largest.blur_ratio);
    }
    return open;
  }

  // Moves a number of the camera file; false for those that the fit does not use, or an impossible
  // value.
  static bool Change(const std::string& field, double change, BlurFitSetup* setup) {
    double* number = field == "lens.front_focal_length_mm"  ? &setup->lens.front_focal_length_mm
                     : field == "lens.rear_focal_length_mm" ? &setup->lens.rear_focal_length_mm
                     : field == "lens.lens_thickness_mm"    ? &setup->lens.lens_thickness_mm
                     : field == "lens.aperture_radius_mm"   ? &setup->lens.aperture_radius_mm
                     : field == "sensor.pixel_pitch_mm"     ? &setup->pixel_pitch_mm
                                                            : nullptr;
    if (number == nullptr) return false;
    *number += change;
    return setup->lens.IsValid(nullptr) && setup->pixel_pitch_mm > 0 &&
           setup->lens.front_focal_length_mm < setup->start_focus_depth_mm;
  }

  // Each side of focus alone. A real lens (spherical aberration, a target that fills the field on
  // one side only) may follow two laws; where the sides disagree by more than their errors, both
  // are inside the interval.
  void IncludeSides(Eigen::Vector2d* focus, Eigen::Vector2d* ratio) {
    const double zf = result_.focus_depth_mm->value;
    std::vector<BlurSample> near, far;
    for (const BlurSample& sample : samples_) {
      const FrameMeasurement& frame = result_.frames[sample.frame];
      if (frame.blur_fit_weight < kOutlierWeight) continue;
      (frame.depth_mm < zf ? near : far).push_back(sample);
    }
    if (near.size() < kFewestOnASide || far.size() < kFewestOnASide) return;
    BlurFitSetup held = setup_;
    held.target_softness = false;  // one side alone cannot tell it from the floor
    held.offset_mm.sigma = 0;      // moves both sides alike
    const BlurFitResult nearer = FitBlur(near, held);
    const BlurFitResult farther = FitBlur(far, held);
    if (!nearer.done || !farther.done) return;
    const double apart_mm = std::abs(nearer.values[0] - farther.values[0]);
    const double sigma_mm = std::sqrt(nearer.covariance(0, 0) + farther.covariance(0, 0));
    if (!(apart_mm > 3 * sigma_mm)) return;
    result_.warnings.push_back(fmt::format(
        "the two sides of focus disagree: the nearer frames alone give {:.2f} +- {:.2f} mm, "
        "the farther ones {:.2f} +- {:.2f} mm",
        nearer.values[0], std::sqrt(nearer.covariance(0, 0)), farther.values[0],
        std::sqrt(farther.covariance(0, 0))));
    for (const BlurFitResult* side : {&nearer, &farther}) {
      *focus = {std::min(focus->x(), side->values[0]), std::max(focus->y(), side->values[0])};
      *ratio = {std::min(ratio->x(), side->values[1]), std::max(ratio->y(), side->values[1])};
    }
  }

  void FillFloor(const FloorChoice& choice, const BlurFitResult& fit) {
    const double floor_px2 = fit.values[2];
    const double error_px2 = std::sqrt(fit.covariance(2, 2));
    if (choice.interval_px2) {
      // Only the interval is known; any value in it would be made up.
      constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
      result_.blur_floor_px =
          Result{kUnknown, kUnknown, Eigen::Vector2d(choice.interval_px2->cwiseSqrt())};
      result_.blur.undetermined.emplace_back("blur_floor_px");
    } else if (floor_px2 > error_px2 || !choice.is_measured) {
      const double floor_px = std::sqrt(std::max(0.0, floor_px2));
      result_.blur_floor_px =
          Result{floor_px, floor_px > 0 ? error_px2 / (2 * floor_px) : 0, std::nullopt};
    } else {
      result_.blur.undetermined.emplace_back("blur_floor_px");
    }
  }

  // From (zf, kappa, S0, offset) to the parameters of the camera file; what is left open has no
  // row.
  void FillCovariance(const BlurFitResult& fit) {
    std::vector<int> rows = {0, 1};
    result_.covariance_order = {"image_distance_mm", "blur_ratio"};
    Eigen::Vector4d slope(model::ImageDistanceSlope(setup_.lens, fit.values[0]), 1, 0, 1);
    const bool floor_is_open = !result_.blur.undetermined.empty();
    if (!floor_is_open) {
      rows.push_back(2);
      result_.covariance_order.emplace_back("blur_floor_px");
      const double floor_px = std::sqrt(std::max(0.0, fit.values[2]));
      slope[2] = floor_px > 0 ? 1 / (2 * floor_px) : 0;
    }
    rows.push_back(3);
    result_.covariance_order.emplace_back("bench_offset_mm");
    const Eigen::Matrix4d full = slope.asDiagonal() * fit.covariance * slope.asDiagonal();
    const auto n = static_cast<Eigen::Index>(rows.size());
    result_.covariance.resize(n, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      for (Eigen::Index j = 0; j < n; ++j) {
        result_.covariance(i, j) =
            full(rows[static_cast<std::size_t>(i)], rows[static_cast<std::size_t>(j)]);
      }
    }
  }

  void Decide() {
    result_.outcome = Outcome::kOk;
    result_.reason.clear();
    if (!result_.blur.undetermined.empty()) {
      result_.outcome = Outcome::kPartial;
      result_.reason = "the data do not fix blur_floor_px; it is not written";
    }
  }

  const FocusSweep& sweep_;
  const std::vector<BlurSample>& samples_;
  bool absolute_;
  Calibration& result_;
  BlurFitSetup setup_;
};

}  // namespace

void SolveFocus(const FocusSweep& sweep, const std::vector<BlurSample>& samples, bool absolute,
                std::size_t reference, Calibration* calibration) {
  Solution(sweep, samples, absolute, reference, calibration).Run();
}

}  // namespace thicklens::calib
