#include "calib/calibrate/focus_results.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calib/calibrate/focus_solution.h"
#include "calib/fit/known_focus.h"
#include "calib/fit/misfit_causes.h"
#include "calib/registration/moving_scale.h"
#include "calib/uncertainty/colour_focus.h"
#include "calib/uncertainty/field_map.h"
#include "calib/uncertainty/systematic_advice.h"
#include "thicklens/base/error.h"
#include "thicklens/base/pi.h"

namespace thicklens::calib {
namespace {

constexpr double kMmPerMetre = 1000;
constexpr double kDiffers = 3;  // standard deviations

Eigen::Vector2d Around(double value, double a, double b) {
  return {std::min({0.0, a - value, b - value}), std::max({0.0, a - value, b - value})};
}

class Conversion {
 public:
  Conversion(const FocusSweep& sweep, model::SweepMotion moves, const FocusMotion& motion,
             const FocusOrigin& origin, Calibration* found)
      : sweep_(sweep),
        lens_(sweep.camera.lens),
        moves_(moves),
        motion_(motion),
        origin_(origin),
        result_(*found),
        sign_(sweep.readings_are_focus_distances ? -1 : model::DirectionSign(sweep.direction)) {}

  void Run() {
    RestoreReadings();
    result_.diagnostics.bench_offset_from = origin_.from;
    result_.diagnostics.compared_focus = origin_.compared;
    ConvertScale();
    const bool has_focus = result_.summary.focus_depth_mm.has_value();
    equivalent_focus_ = result_.summary.focus_depth_mm;
    equivalent_offset_mm_ =
        result_.summary.bench_offset_mm ? result_.summary.bench_offset_mm->value : 0;
    const auto reading = result_.diagnostics.focus_reading_mm;
    if (reading) {
      const auto at = motion_.ReadingAt(reading->value);
      if (at) {
        result_.diagnostics.focus_reading_mm = model::Estimate{*at, reading->sigma * PerDepth(*at)};
      } else {
        result_.diagnostics.focus_reading_mm.reset();
      }
    }
    ConvertSlope();
    if (!has_focus || !result_.diagnostics.focus_reading_mm) {
      Forget();
      return;
    }
    FindFocus();
    ConvertParts();
    ConvertValues();
    ConvertPeaks();
    ConvertSides();
    ConvertField();
    ConvertFrames();
    FillPositions();
    AddFocalLength();
    AddContradictions();
    AddPupilLaws();
    CompareGain();
    SortAndAdvise(&result_);
    CheckDepth();
  }

 private:
  // d reading/d z' near a reading, absolute.
  double PerDepth(double reading_mm) const {
    const double step_mm =
        1e-5 * motion_.unit_mm() / std::max(1e-12, DistancePerReading(reading_mm));
    const auto above = motion_.EquivalentDepthMm(reading_mm + step_mm);
    const auto below = motion_.EquivalentDepthMm(reading_mm - step_mm);
    if (!above || !below || *above == *below) return 1;
    return std::abs(2 * step_mm / (*above - *below));
  }
  // |dD/d reading|.
  double DistancePerReading(double reading_mm) const {
    return sweep_.readings_are_focus_distances
               ? std::abs(model::ImageDistanceSlope(lens_, reading_mm))
               : 1;
  }

  void RestoreReadings() {
    result_.diagnostics.moves = moves_;
    for (std::size_t i = 0; i < result_.frames.size(); ++i) {
      FrameMeasurement& frame = result_.frames[i];
      frame.reading_mm = sweep_.frames[i].reading_mm;
      // z' falls where D grows.
      const double per_depth = PerDepth(frame.reading_mm);
      frame.reading_error_mm *= -sign_ * per_depth;
      frame.reading_error_sigma_mm *= per_depth;
      frame.stage_error_mm *= -sign_ * per_depth;
      frame.image_distance_mm =
          motion_.SensorDistanceMm(frame.reading_mm) + lens_.lens_thickness_mm;
    }
    SharpestReading& sharpest = result_.diagnostics.sharpest;
    if (sharpest.done) {
      if (const auto at = motion_.ReadingAt(sharpest.reading_mm.value)) {
        sharpest.reading_mm = {*at, sharpest.reading_mm.sigma * PerDepth(*at)};
      }
    }
  }

  // The law of 1/z is that of the equivalent target, which nobody sees.
  void ConvertScale() {
    ScaleModel& scale = result_.diagnostics.scale;
    equivalent_zero_mm_ =
        scale.done ? std::optional(model::Estimate{scale.offset_mm.value, scale.offset_mm.sigma})
                   : std::nullopt;
    // Readings grow the other way than z' where D grows with them.
    if (scale.change_over_sweep) scale.change_over_sweep->value *= -sign_;
    if (scale.kind == ScaleKind::kInverseDepth) scale.kind = ScaleKind::kMovingFocus;
    if (!scale.done) return;
    scale.done = false;
    scale.kind = ScaleKind::kMovingFocus;
    scale.message = fmt::format("the image scale changes with the position of the {}",
                                model::SweepMotionName(moves_));
  }

  // The slope is per mm of z', which is dD at focus.
  void ConvertSlope() {
    auto& slope = result_.diagnostics.blur_slope_px_per_mm;
    if (!slope) return;
    const double per_reading =
        sweep_.readings_are_focus_distances && result_.diagnostics.focus_reading_mm
            ? DistancePerReading(result_.diagnostics.focus_reading_mm->value)
            : 1;
    slope->value *= per_reading;
    slope->sigma *= per_reading;
  }

  void Forget() {
    result_.summary.bench_offset_mm.reset();
    result_.diagnostics.magnification_at_focus.reset();
    result_.diagnostics.paper_recipe.done = false;
    result_.diagnostics.sharpness.done = false;
    for (FrameMeasurement& frame : result_.frames) frame.depth_mm = 0;
  }

  // ---- D and zf ----
  // xf for a zf of the equivalent sweep, mm.
  double DistanceOf(double equivalent_mm) const {
    if (origin_.stated) return origin_.sensor_distance_mm.value;
    const auto reading = motion_.ReadingAt(equivalent_mm - equivalent_offset_mm_);
    return reading ? motion_.SensorDistanceMm(*reading) : motion_.SensorDistanceAtFocusMm();
  }
  // zf of an xf, which stays behind the focal point.
  double DepthOf(double distance_mm) const {
    const double least_mm = lens_.rear_focal_length_mm * (1 + 1e-9);
    return model::FocusDepthMm(lens_, std::max(distance_mm, least_mm) + lens_.lens_thickness_mm);
  }

  void FindFocus() {
    const double zf = equivalent_focus_->value, h = 1e-5 * zf;
    const double slope = std::abs(DistanceOf(zf + h) - DistanceOf(zf - h)) / (2 * h);
    xf_mm_.value = DistanceOf(zf);
    // The reading at focus and the statement each have an error.
    xf_mm_.sigma = slope * equivalent_focus_->sigma;
    xf_mm_.sigma = std::hypot(xf_mm_.sigma, origin_.sensor_distance_mm.sigma);
    zf_mm_ = DepthOf(xf_mm_.value);
  }

  double DepthSlope() const { return 1 / std::abs(model::ImageDistanceSlope(lens_, zf_mm_)); }

  // dln(kappa)/dxf: the growth of the blur gives kappa for an xf.
  double RatioPerDistance() const {
    if (sweep_.readings_are_focus_distances) return 0;
    const double h = 1e-4 * (xf_mm_.value - lens_.rear_focal_length_mm);
    const FocusMotion above(sweep_, moves_, xf_mm_.value + h, motion_.focus_reading_mm());
    const FocusMotion below(sweep_, moves_, xf_mm_.value - h, motion_.focus_reading_mm());
    return (std::log(below.BlurGrowth()) - std::log(above.BlurGrowth())) / (2 * h);
  }

  void ConvertParts() {
    const double zf = equivalent_focus_->value;
    for (SystematicPart& part : result_.diagnostics.systematic_parts) {
      const double a_mm = DistanceOf(zf + part.focus_depth_mm.x());
      const double b_mm = DistanceOf(zf + part.focus_depth_mm.y());
      part.image_distance_mm = Around(xf_mm_.value, a_mm, b_mm);
      part.focus_depth_mm = Around(zf_mm_, DepthOf(a_mm), DepthOf(b_mm));
    }
  }

  void ConvertValues() {
    CalibrationSummary& summary = result_.summary;
    const double rho_mm = lens_.lens_thickness_mm;
    Result distance{xf_mm_.value + rho_mm, xf_mm_.sigma, std::nullopt};
    Result depth{zf_mm_, DepthSlope() * xf_mm_.sigma, std::nullopt};
    if (equivalent_focus_->systematic) {
      const double a_mm = DistanceOf(equivalent_focus_->systematic->x());
      const double b_mm = DistanceOf(equivalent_focus_->systematic->y());
      distance.systematic = Around(xf_mm_.value, a_mm, b_mm).array() + distance.value;
      depth.systematic = Around(zf_mm_, DepthOf(a_mm), DepthOf(b_mm)).array() + depth.value;
    }
    const double ratio_by_xf = RatioPerDistance();
    if (summary.blur_ratio) {
      summary.blur_ratio->sigma =
          std::hypot(summary.blur_ratio->sigma,
                     summary.blur_ratio->value * ratio_by_xf * origin_.sensor_distance_mm.sigma);
    }
    ConvertCovariance(ratio_by_xf);
    summary.image_distance_mm = distance;
    summary.focus_depth_mm = depth;
    const double f1_mm = lens_.front_focal_length_mm;
    result_.diagnostics.magnification_at_focus =
        model::Estimate{model::MagnificationAtFocus(lens_, zf_mm_),
                        f1_mm * depth.sigma / std::pow(zf_mm_ - f1_mm, 2)};
    summary.bench_offset_mm.reset();
    if (!sweep_.readings_are_focus_distances) {
      const model::Estimate& reading = *result_.diagnostics.focus_reading_mm;
      summary.bench_offset_mm =
          Result{distance.value - sign_ * reading.value, distance.sigma, std::nullopt};
    }
  }

  // Keeps d1, kappa and the floor; the zero of the scale of a lens is no depth.
  void ConvertCovariance(double ratio_by_xf) {
    std::vector<std::string>& names = result_.diagnostics.covariance_order;
    Eigen::MatrixXd& covariance = result_.diagnostics.covariance;
    const auto offset = std::find(names.begin(), names.end(), "bench_offset_mm");
    if (covariance.rows() < 2 || offset == names.end()) return;
    names.erase(offset);
    const auto n = static_cast<Eigen::Index>(names.size());
    const model::ThickLens equivalent = motion_.EquivalentLens();
    // d1 of the equivalent lens has the error of its zf times this.
    const double own_slope = model::ImageDistanceSlope(equivalent, equivalent_focus_->value);
    Eigen::MatrixXd kept = covariance.topLeftCorner(n, n);
    const double h = 1e-5 * equivalent_focus_->value;
    const double slope =
        (DistanceOf(equivalent_focus_->value + h) - DistanceOf(equivalent_focus_->value - h)) /
        (2 * h);
    kept.row(0) *= slope / own_slope;
    kept.col(0) *= slope / own_slope;
    const double variance_mm2 = std::pow(origin_.sensor_distance_mm.sigma, 2);
    const double by_ratio =
        result_.summary.blur_ratio ? result_.summary.blur_ratio->value * ratio_by_xf : 0;
    kept(0, 0) += variance_mm2;
    kept(0, 1) += by_ratio * variance_mm2;
    kept(1, 0) += by_ratio * variance_mm2;
    kept(1, 1) += by_ratio * by_ratio * variance_mm2;
    covariance = kept;
  }

  // ---- the other findings ----
  void ConvertPeaks() {
    SourceRecipe& recipe = result_.diagnostics.paper_recipe;
    if (recipe.done) {
      recipe.image_distance_mm = DistanceOf(recipe.focus_depth_mm) + lens_.lens_thickness_mm;
      recipe.focus_depth_mm = DepthOf(DistanceOf(recipe.focus_depth_mm));
      if (recipe.normalised_focus_depth_mm > 0)
        recipe.normalised_focus_depth_mm = DepthOf(DistanceOf(recipe.normalised_focus_depth_mm));
    }
    SharpnessPeak& peak = result_.diagnostics.sharpness;
    if (peak.done) {
      const double distance_mm = DistanceOf(peak.focus_depth_mm);
      const double beside_mm = DistanceOf(peak.focus_depth_mm + peak.sigma_mm);
      peak.sigma_mm = std::abs(DepthOf(beside_mm) - DepthOf(distance_mm));
      peak.focus_depth_mm = DepthOf(distance_mm);
      peak.reference_depth_mm = peak.from_depth_mm = peak.to_depth_mm = 0;
    }
  }

  // Frames whose z' is smaller have the sensor farther back and are focused nearer: the target is
  // beyond their plane of focus.
  void ConvertSides() {
    if (motion_.blur_per_scale() > 0)
      std::swap(result_.diagnostics.nearer, result_.diagnostics.farther);
    for (SideFit* side : {&result_.diagnostics.nearer, &result_.diagnostics.farther}) {
      if (!side->done) continue;
      const double distance_mm = DistanceOf(side->focus_depth_mm.value);
      const double beside_mm = DistanceOf(side->focus_depth_mm.value + side->focus_depth_mm.sigma);
      side->focus_depth_mm = {DepthOf(distance_mm),
                              std::abs(DepthOf(beside_mm) - DepthOf(distance_mm))};
    }
  }

  // A part of the image that is sharpest at another z' has an image that lies farther back by
  // -g dz'; with the sensor at xf it shows objects in focus whose image is nearer by that.
  model::Estimate FocusBeside(const model::Estimate& equivalent_mm) const {
    const double g = motion_.ImageDifference();
    const double back_mm = -g * (equivalent_mm.value - equivalent_focus_->value);
    const double depth_mm = DepthOf(xf_mm_.value - back_mm);
    return {depth_mm, std::abs(g) * equivalent_mm.sigma * DepthSlope()};
  }

  // Warnings that name values of the field are written again with the converted ones.
  void ConvertField() {
    const std::vector<std::string> before = WordsOfField();
    ConvertFieldValues();
    const std::vector<std::string> after = WordsOfField();
    auto& warnings = result_.summary.warnings;
    for (std::size_t i = 0; i < before.size(); ++i) {
      if (before[i].empty()) continue;
      const auto at = std::find(warnings.begin(), warnings.end(), before[i]);
      if (at == warnings.end()) continue;
      if (i >= after.size() || after[i].empty())
        warnings.erase(at);
      else
        *at = after[i];
    }
  }

  std::vector<std::string> WordsOfField() const {
    std::vector<std::string> words = {AstigmatismInWords(result_), ColoursInWords(result_)};
    for (const std::string& warning : FieldWarnings(result_)) words.push_back(warning);
    return words;
  }

  void ConvertFieldValues() {
    FieldMap& field = result_.diagnostics.field;
    for (FieldTile& tile : field.tiles) {
      if (tile.done) tile.focus_depth_mm = FocusBeside(tile.focus_depth_mm);
    }
    for (DepthCluster& cluster : field.clusters)
      cluster.focus_depth_mm = FocusBeside(cluster.focus_depth_mm);
    for (auto* axis : {&field.along_x, &field.along_y}) {
      if (*axis) (*axis)->focus_depth_mm = FocusBeside((*axis)->focus_depth_mm);
    }
    for (ChannelFocus& channel : result_.diagnostics.channels) {
      if (channel.done) channel.focus_depth_mm = FocusBeside(channel.focus_depth_mm);
    }
    // The image of a part that is sharpest at a larger z' lies nearer to the lens (FocusBeside).
    const double depth_factor = -motion_.ImageDifference() * DepthSlope();
    for (auto* difference : {&field.curvature_mm, &field.astigmatism_mm}) {
      if (!*difference) continue;
      (*difference)->value *= depth_factor;
      (*difference)->sigma *= std::abs(depth_factor);
    }
    // Depth differences by depth_factor, and widths on the target by |A|/m.
    const double m = model::MagnificationAtFocus(lens_, zf_mm_);
    const double tilt_factor = depth_factor * m / std::abs(motion_.blur_per_scale());
    for (auto* tilt : {&field.tilt_right_deg, &field.tilt_down_deg}) {
      if (!*tilt) continue;
      const double slope = std::tan((*tilt)->value * kPi / 180);
      const double moved = tilt_factor * slope;
      (*tilt)->sigma *= std::abs(tilt_factor) * (1 + slope * slope) / (1 + moved * moved);
      (*tilt)->value = std::atan(moved) * 180 / kPi;
    }
  }

  // The depth at which the camera, focused on zf, shows the blur of a frame: m (zf/z - 1) = c.
  double DepthOfBlur(double reading_mm) const {
    const double m = model::MagnificationAtFocus(lens_, zf_mm_) * lens_.rear_focal_length_mm /
                     lens_.front_focal_length_mm;
    const auto defocus = motion_.DefocusPerAperture(reading_mm);
    if (!defocus) return 0;
    const double inverse = 1 + *defocus / m;
    return inverse > 0 ? zf_mm_ / inverse : 0;
  }

  void ConvertFrames() {
    // D of each reading by the result.
    const double moved_mm = xf_mm_.value - motion_.SensorDistanceMm(FocusReading());
    for (FrameMeasurement& frame : result_.frames) {
      *frame.image_distance_mm += moved_mm;
      const double at = DepthOfBlur(frame.reading_mm);
      frame.depth_mm = std::isfinite(at) ? at : 0;
      const double step_mm = 1e-4 / std::max(1e-12, DistancePerReading(frame.reading_mm));
      const double beside = DepthOfBlur(frame.reading_mm + step_mm);
      frame.depth_per_reading =
          frame.depth_mm > 0 && beside > 0 ? std::abs(beside - frame.depth_mm) / step_mm : 0;
    }
  }

  double FocusReading() const { return result_.diagnostics.focus_reading_mm->value; }

  void FillPositions() {
    const bool in_dioptres = sweep_.readings_are_focus_distances;
    model::FocusPositions positions;
    positions.unit = in_dioptres ? model::kDioptreUnit : "mm";
    for (const FrameMeasurement& frame : result_.frames) {
      positions.positions.push_back(
          {in_dioptres ? kMmPerMetre / frame.reading_mm : frame.reading_mm,
           *frame.image_distance_mm});
    }
    auto& list = positions.positions;
    std::sort(list.begin(), list.end(),
              [](const auto& a, const auto& b) { return a.reading < b.reading; });
    list.erase(std::unique(list.begin(), list.end(),
                           [](const auto& a, const auto& b) { return a.reading == b.reading; }),
               list.end());
    if (positions.IsValid(nullptr)) result_.diagnostics.focus_positions = std::move(positions);
  }

  // ---- the errors of the conversion ----
  // Adds to an interval linearly, as WidenByTrials does: these are bounds.
  void Widen(SystematicPart part) {
    const auto add = [](std::optional<Result>* result, const Eigen::Vector2d& moves) {
      if (!*result) return;
      if (!(*result)->systematic)
        (*result)->systematic = Eigen::Vector2d((*result)->value, (*result)->value);
      *(*result)->systematic += moves;
    };
    add(&result_.summary.focus_depth_mm, part.focus_depth_mm);
    add(&result_.summary.image_distance_mm, part.image_distance_mm);
    add(&result_.summary.blur_ratio, part.blur_ratio);
    result_.diagnostics.systematic_parts.push_back(std::move(part));
  }

  static void Include(double move, Eigen::Vector2d* interval) {
    *interval = {std::min(interval->x(), move), std::max(interval->y(), move)};
  }

  // xf, zf and kappa with focal lengths at an end of their tolerance.
  void IncludeStretched(double factor, SystematicPart* part) const {
    FocusSweep changed = sweep_;
    changed.camera.lens = Stretched(lens_, factor);
    const model::ThickLens& lens = changed.camera.lens;
    double xf_mm = xf_mm_.value;
    if (sweep_.readings_are_focus_distances) {
      xf_mm = SensorDistanceOf(lens, FocusReading());
    } else if (origin_.stated) {
      xf_mm = SensorDistanceOf(lens, model::FocusDepthOf(lens, *origin_.stated).value);
    } else if (moves_ == model::SweepMotion::kLens && origin_.from == kFromScale) {
      const MovingScale again = FitAgain(lens);
      if (again.sensor_distance_mm) xf_mm = again.sensor_distance_mm->value;
    }
    if (!(xf_mm > lens.rear_focal_length_mm)) return;
    const FocusMotion other(changed, moves_, xf_mm, FocusReading());
    const FocusMotion own(sweep_, moves_, xf_mm_.value, FocusReading());
    Include(other.FocusDepthMm() - zf_mm_, &part->focus_depth_mm);
    Include(xf_mm - xf_mm_.value, &part->image_distance_mm);
    if (result_.summary.blur_ratio) {
      Include(result_.summary.blur_ratio->value * (own.BlurGrowth() / other.BlurGrowth() - 1),
              &part->blur_ratio);
    }
  }

  MovingScale FitAgain(const model::ThickLens& lens) const {
    std::vector<ScaleSample> samples;
    for (std::size_t i = 0; i < result_.frames.size(); ++i) {
      const FrameMeasurement& frame = result_.frames[i];
      if (!frame.image_scale || !frame.rejection.empty()) continue;
      ScaleSample sample;
      sample.frame = i;
      sample.reading_mm = frame.reading_mm;
      sample.scale = *frame.image_scale;
      sample.registration.scale_sigma = frame.image_scale_sigma;
      samples.push_back(sample);
    }
    return FitMovingScale(samples, lens, moves_, sign_, FocusReading(), sweep_.reading_sigma_mm);
  }

  void AddFocalLength() {
    const double tolerance = FocalLengthTolerance(sweep_.camera);
    if (!(tolerance > 0)) return;
    SystematicPart part;
    part.name = kFrontFocalLength;
    part.remedy =
        StatesFocalLength(sweep_.camera)
            ? fmt::format("measure {} better than +- {:.3g} %", kFrontFocalLength, 100 * tolerance)
            : fmt::format("state the tolerance of {} ({:.0f} % is assumed)", kFrontFocalLength,
                          100 * tolerance);
    for (const double factor : {1 - tolerance, 1 + tolerance}) {
      try {
        IncludeStretched(factor, &part);
      } catch (const Error& impossible) {
        result_.summary.warnings.push_back(
            fmt::format("{}: an end of its tolerance is impossible, and the intervals do not "
                        "include it ({})",
                        kFrontFocalLength, impossible.what()));
      }
    }
    Widen(std::move(part));
  }

  // The intervals include the other side of a contradiction.
  void AddContradictions() {
    for (const double distance_mm : origin_.contradicting_mm) AddContradiction(distance_mm);
  }

  void AddContradiction(double distance_mm) {
    if (!(distance_mm > lens_.rear_focal_length_mm)) return;
    SystematicPart part;
    part.name = fmt::format("contradiction to {}", origin_.from);
    part.remedy = "find out which of the statements is wrong, and state the reliable one alone";
    part.image_distance_mm = Around(xf_mm_.value, distance_mm, distance_mm);
    const double depth_mm = DepthOf(distance_mm);
    part.focus_depth_mm = Around(zf_mm_, depth_mm, depth_mm);
    if (result_.summary.blur_ratio) {
      const FocusMotion own(sweep_, moves_, xf_mm_.value, FocusReading());
      const FocusMotion other(sweep_, moves_, distance_mm, FocusReading());
      const double kappa = result_.summary.blur_ratio->value;
      part.blur_ratio = Around(kappa, kappa * own.BlurGrowth() / other.BlurGrowth(), kappa);
    }
    Widen(std::move(part));
  }

  // If the readings are focus distances, their spacing and the focal length predict how the scale
  // changes: a zero of the equivalent target beyond its error is a wrong gain of the drive.
  void CompareGain() {
    if (!sweep_.readings_are_focus_distances || !equivalent_zero_mm_) return;
    const double off = equivalent_zero_mm_->value / motion_.unit_mm();
    const double sigma = equivalent_zero_mm_->sigma / motion_.unit_mm();
    const double tolerance = 2 * FocalLengthTolerance(sweep_.camera);
    if (!(std::abs(off) > kDiffers * sigma + tolerance)) return;
    result_.summary.warnings.push_back(fmt::format(
        "the image scale changes by {:.1f} +- {:.1f} % of what the dioptres of the readings and "
        "the focal length ({:.4g} mm) predict: the drive is calibrated differently, the focal "
        "length is wrong, or the {} moves and not the {}; kappa is in proportion to that",
        100 / (1 + off), 100 * sigma, lens_.front_focal_length_mm,
        model::SweepMotionName(moves_ == model::SweepMotion::kLens ? model::SweepMotion::kSensor
                                                                   : model::SweepMotion::kLens),
        model::SweepMotionName(moves_)));
    SystematicPart part;
    part.name = "gain of the focus drive";
    part.remedy = "measure the distances at which two of its positions are in focus";
    if (result_.summary.blur_ratio) {
      const double kappa = result_.summary.blur_ratio->value;
      const double reach = std::copysign(std::abs(off) + 2 * sigma, off);
      part.blur_ratio = Around(kappa, kappa * (1 + reach), kappa);
    }
    Widen(std::move(part));
  }

  // The image scale measures from the centre of perspective, which depends on the light over the
  // pupil.
  void AddPupilLaws() {
    if (origin_.pupil_interval_mm.isZero()) return;
    SystematicPart part;
    part.name = "light distribution over the pupil";
    part.remedy =
        "state focus_depth_mm, magnification or image_distance_mm: a distance from the image scale "
        "depends on how the light is distributed over the pupil";
    const FocusMotion own(sweep_, moves_, xf_mm_.value, FocusReading());
    for (const double move_mm : {origin_.pupil_interval_mm.x(), origin_.pupil_interval_mm.y()}) {
      const double distance_mm = xf_mm_.value + move_mm;
      if (!(distance_mm > lens_.rear_focal_length_mm)) continue;
      const FocusMotion other(sweep_, moves_, distance_mm, FocusReading());
      Include(distance_mm - xf_mm_.value, &part.image_distance_mm);
      Include(other.FocusDepthMm() - zf_mm_, &part.focus_depth_mm);
      if (result_.summary.blur_ratio) {
        Include(result_.summary.blur_ratio->value * (own.BlurGrowth() / other.BlurGrowth() - 1),
                &part.blur_ratio);
      }
    }
    Widen(std::move(part));
  }

  // d1 and kappa may be known well where zf is not: near infinity zf grows without bound.
  void CheckDepth() {
    const double beyond_mm = xf_mm_.value - lens_.rear_focal_length_mm;
    if (beyond_mm > kKnownSigmas * xf_mm_.sigma) return;
    const std::string reason = fmt::format(
        "zf is not determined: d1 - rho = {:.5g} +- {:.2g} mm by {} is too near to the focal "
        "length of {:.4g} mm, from which zf goes to infinity; state focus_depth_mm, the distance "
        "of the target from the aperture",
        xf_mm_.value, xf_mm_.sigma, origin_.from, lens_.rear_focal_length_mm);
    if (result_.summary.outcome == Outcome::kOk) {
      result_.summary.outcome = Outcome::kPartial;
      result_.summary.reason = reason;
    } else {
      result_.summary.warnings.push_back(reason);
    }
  }

  const FocusSweep& sweep_;
  const model::ThickLens& lens_;
  model::SweepMotion moves_;
  const FocusMotion& motion_;
  const FocusOrigin& origin_;
  Calibration& result_;
  double sign_;  // of dD/d reading
  std::optional<Result> equivalent_focus_;
  double equivalent_offset_mm_ = 0;
  std::optional<model::Estimate> equivalent_zero_mm_;
  model::Estimate xf_mm_;
  double zf_mm_ = 0;
};

}  // namespace

void ConvertResults(const FocusSweep& sweep, model::SweepMotion moves, const FocusMotion& motion,
                    const FocusOrigin& origin, Calibration* found) {
  Conversion(sweep, moves, motion, origin, found).Run();
}

}  // namespace thicklens::calib
