#include "calib/calibrate/moving_focus.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "calib/calibrate/focus_results.h"
#include "calib/calibrate/zero_choice.h"
#include "calib/fit/blur_measurement.h"
#include "calib/fit/known_focus.h"
#include "calib/registration/moving_scale.h"
#include "calib/registration/scale_tracking.h"
#include "calib/sweep/frame_selection.h"
#include "calib/uncertainty/systematic_advice.h"
#include "thicklens/base/error.h"
#include "thicklens/base/statistics.h"
#include "thicklens/model/pupil_law.h"

namespace thicklens::calib {
namespace {

constexpr double kWrongWay = 5;      // standard deviations of the scale's slope
constexpr double kPartOfStep = 0.2;  // of the readings, by which the reading at focus may be off
constexpr double kMinGrowth = 0.02;  // A below which the blur of a lens at 1:1 does not change
constexpr double kGainDiffers = 3;   // standard deviations
constexpr double kScaleMustBeBetter = 2;  // than a statement, as a ratio of errors
constexpr std::size_t kMinScales = 5;
constexpr double kReach = 2;             // standard deviations of the other side of a contradiction
constexpr double kPartOfSigma = 0.05;    // of the scale's zero that is left
constexpr double kNearestFocus = 1.001;  // of f2: a nearer sensor has no object in focus

// A value of xf and its source.
struct Focus {
  model::Estimate distance_mm;
  std::string from;
  std::optional<model::StatedConjugate> stated;
};

class MovingFocus {
 public:
  MovingFocus(const FocusSweep& sweep, model::SweepMotion moves, const TargetCalibration& target)
      : sweep_(sweep),
        lens_(sweep.camera.lens),
        moves_(moves),
        sign_(model::DirectionSign(sweep.direction)),
        target_(target) {}

  Calibration Run() {
    const auto begin = std::chrono::steady_clock::now();
    Calibration found = Solve();
    found.summary.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return found;
  }

 private:
  Calibration Solve() {
    preview_ = target_.preview(sweep_);
    if (!preview_.passed) return Finished(std::move(preview_.found));
    focus_reading_mm_ = SharpestReadingMm();
    if (const auto reason = FindFocus()) return Refused(*reason);
    constexpr int kRounds = 3;
    for (int round = 0; round < kRounds; ++round) {
      const FocusMotion motion(sweep_, moves_, focus_.distance_mm.value, focus_reading_mm_);
      if (const auto reason = ReasonAgainst(motion)) return Refused(*reason);
      Calibration found = target_.run(EquivalentSweep(motion), motion);
      const auto reading_mm = FocusReading(found, motion);
      const bool is_last = round + 1 == kRounds;
      if (!reading_mm || is_last || std::abs(*reading_mm - focus_reading_mm_) < PartOfStepMm())
        return Converted(std::move(found), motion);
      MoveFocusTo(*reading_mm);
    }
    return Refused("the reading at focus was not found");
  }

  Calibration Finished(Calibration found) const {
    found.diagnostics.moves = moves_;
    return found;
  }

  Calibration Refused(const std::string& reason) {
    Calibration found = preview_.found;
    found.summary.outcome = Outcome::kRefused;
    found.summary.reason = reason;
    return Finished(std::move(found));
  }

  double SharpestReadingMm() const {
    const SharpestReading& sharpest = preview_.found.diagnostics.sharpest;
    return sharpest.done ? sharpest.reading_mm.value
                         : preview_.found.frames[preview_.reference].reading_mm;
  }

  double PartOfStepMm() const {
    std::vector<double> readings;
    for (const FrameMeasurement& frame : preview_.found.frames)
      readings.push_back(frame.reading_mm);
    const auto [low, high] = std::minmax_element(readings.begin(), readings.end());
    return kPartOfStep * (*high - *low) / static_cast<double>(readings.size());
  }

  // A stated xf stays; that of an offset moves with the reading at focus.
  void MoveFocusTo(double reading_mm) {
    if (!focus_.stated && !sweep_.readings_are_focus_distances)
      focus_.distance_mm.value += sign_ * (reading_mm - focus_reading_mm_);
    focus_reading_mm_ = reading_mm;
  }

  // ---- xf ----
  std::vector<model::StatedConjugate> Statements() const {
    std::vector<model::StatedConjugate> statements = sweep_.stated_focus;
    if (sweep_.target_period_mm) {
      const cv::Mat grey =
          LinearGrey(sweep_.read_frame(preview_.reference), sweep_, preview_.reference);
      if (const auto measured = MagnificationOfPeriod(sweep_, grey, 0))
        statements.push_back(*measured);
    }
    return statements;
  }

  model::Estimate SensorDistanceOfStatement(const model::StatedConjugate& stated) const {
    const model::Estimate depth_mm = model::FocusDepthOf(lens_, stated);
    return {SensorDistanceOf(lens_, depth_mm.value),
            std::abs(model::ImageDistanceSlope(lens_, depth_mm.value)) * depth_mm.sigma};
  }

  // The change of a statement's xf with the tolerance of the focal lengths, as a sigma.
  double ErrorByFocalLength(const model::StatedConjugate& stated) const {
    model::ThickLens longer = lens_;
    const double change = FocalLengthTolerance(sweep_.camera) / std::sqrt(3.0);
    longer.front_focal_length_mm *= 1 - change;
    longer.rear_focal_length_mm *= 1 - change;
    const double shifted_mm = SensorDistanceOf(longer, model::FocusDepthOf(longer, stated).value);
    return shifted_mm - SensorDistanceOfStatement(stated).value;
  }

  std::optional<std::string> FindFocus() {
    if (sweep_.readings_are_focus_distances) return FocusOfDistances();
    scale_ = FitMovingScale(preview_.samples, lens_, moves_, sign_, focus_reading_mm_,
                            sweep_.reading_sigma_mm);
    if (scale_.slope_per_mm.sigma > 0 &&
        sign_ * scale_.slope_per_mm.value < -kWrongWay * scale_.slope_per_mm.sigma) {
      const bool is_away = sweep_.direction == model::BenchDirection::kAway;
      return fmt::format(
          "the image grows toward {} readings, but with moves: {} and direction: {} the distance "
          "from the lens to the sensor, and the image with it, grows toward {} ones: direction "
          "must be '{}', or something else moves",
          is_away ? "smaller" : "larger", model::SweepMotionName(moves_),
          is_away ? "away" : "toward", is_away ? "larger" : "smaller", is_away ? "toward" : "away");
    }
    std::vector<Focus> known;
    for (const model::StatedConjugate& stated : Statements())
      known.push_back({SensorDistanceOfStatement(stated), stated.name, stated});
    if (sweep_.offset_mm) {
      known.push_back(
          {{sweep_.offset_mm->value - lens_.lens_thickness_mm + sign_ * focus_reading_mm_,
            sweep_.offset_mm->sigma},
           kFromOffset,
           std::nullopt});
    }
    if (const auto by_scale = FocusOfScale()) known.push_back(*by_scale);
    // A statement is preferred unless the image scale is clearly better.
    const auto best =
        std::min_element(known.begin(), known.end(), [&](const Focus& a, const Focus& b) {
          const auto cost = [&](const Focus& focus) {
            return (focus.from == kFromScale ? kScaleMustBeBetter : 1) * ErrorMm(focus);
          };
          return cost(a) < cost(b);
        });
    if (best == known.end()) return ReasonOfUnknownFocus();
    focus_ = *best;
    if (!(focus_.distance_mm.value > kNearestFocus * lens_.rear_focal_length_mm))
      return ReasonOfImpossibleFocus();
    for (const Focus& other : known) {
      if (&other != &*best) Compare(other);
    }
    return std::nullopt;
  }

  std::optional<std::string> FocusOfDistances() {
    for (const model::SweepFrame& frame : sweep_.frames) {
      if (frame.reading_mm > kNearestFocus * lens_.front_focal_length_mm) continue;
      return fmt::format(
          "{} is focused on {:.4g} mm ({:.4g} dpt), nearer than the focal length ({:.4g} mm): "
          "check "
          "the unit of the readings and the focal length",
          frame.Name(), frame.reading_mm, kMmPerMetre / frame.reading_mm,
          lens_.front_focal_length_mm);
    }
    focus_.distance_mm = {SensorDistanceOf(lens_, focus_reading_mm_), 0};
    focus_.from = kFromDioptres;
    // The dioptres of a drive are nominal; a statement beside them is only compared.
    for (const model::StatedConjugate& stated : Statements())
      Compare({SensorDistanceOfStatement(stated), stated.name, stated});
    return std::nullopt;
  }

  std::optional<std::string> ReasonOfUnknownFocus() const {
    const bool is_scale_open = preview_.samples.size() >= kMinScales;
    return fmt::format(
        "nothing determines the distance from the lens to the sensor, on which d1, zf and kappa "
        "depend: {}. State one of: focus_depth_mm (the distance of the target from the aperture), "
        "magnification, target_period_mm (with a grid or ruler of that period in view), "
        "image_distance_mm (at the reading at focus), or offset_mm (d1 at reading 0)",
        !is_scale_open ? "the image scale could be measured on too few frames"
        : moves_ == model::SweepMotion::kLens
            ? "where the lens moves, the image scale changes by the same share per mm for any "
              "distance (1/f), and this sweep is too short for the small difference"
            : "the image scale changes too little over this sweep, or not as that of a sensor "
              "behind a lens of this focal length");
  }

  std::optional<std::string> ReasonOfImpossibleFocus() const {
    return fmt::format(
        "by {}, the sensor is {:.4g} +- {:.2g} mm behind the lens at the reading at focus "
        "({}), but a lens of {:.4g} mm has objects in focus only at larger distances: check "
        "{}, the focal length, the unit of the readings and what moves",
        focus_.from, focus_.distance_mm.value, focus_.distance_mm.sigma,
        ReadingInWords(sweep_, focus_reading_mm_), lens_.rear_focal_length_mm, focus_.from);
  }

  // The error of a source with that of the focal lengths.
  double ErrorMm(const Focus& focus) const {
    return focus.stated ? std::hypot(focus.distance_mm.sigma, ErrorByFocalLength(*focus.stated))
                        : focus.distance_mm.sigma;
  }

  // xf by the image scale. The scale of a sensor that moves is that of the equivalent target, whose
  // zero is by how much the assumed xf is too small; xf is found when the zero is 0.
  std::optional<Focus> FocusOfScale() {
    if (!scale_.sensor_distance_mm) return std::nullopt;
    Focus focus{*scale_.sensor_distance_mm, kFromScale, std::nullopt};
    if (moves_ == model::SweepMotion::kLens) return focus;
    constexpr int kRounds = 4;
    for (int round = 0; round < kRounds; ++round) {
      if (!(focus.distance_mm.value > kNearestFocus * lens_.rear_focal_length_mm)) return focus;
      const FocusMotion motion(sweep_, moves_, focus.distance_mm.value, focus_reading_mm_);
      std::vector<ScaleSample> samples;
      for (ScaleSample sample : preview_.samples) {
        const auto depth_mm = motion.EquivalentDepthMm(sample.reading_mm);
        if (!depth_mm) continue;
        sample.reading_mm = *depth_mm;
        samples.push_back(sample);
      }
      const ScaleModel law =
          FitScaleModel(samples, static_cast<int>(preview_.reference), sweep_.reading_sigma_mm,
                        model::BenchDirection::kAway, RegionCornerRadiusPx(sweep_));
      if (!law.done) return round == 0 ? std::nullopt : std::optional(focus);
      Eigen::Vector2d zeros_mm(0, 0);
      double zero_mm = 0;
      for (const model::PupilLaw pupil : model::AllPupilLaws()) {
        const double at_mm =
            law.offset_mm.value +
            motion.EquivalentCentreMm(model::CentreOfPerspectiveMm(
                lens_, sweep_.camera.psf, pupil, kDefaultRatio, motion.FocusDepthMm()));
        const bool is_first = pupil == model::AllPupilLaws().front();
        zeros_mm = {is_first ? at_mm : std::min(zeros_mm.x(), at_mm),
                    is_first ? at_mm : std::max(zeros_mm.y(), at_mm)};
        if (pupil == model::PupilLaw::kPaper) zero_mm = at_mm;
      }
      focus.distance_mm = {focus.distance_mm.value + zero_mm, law.offset_mm.sigma};
      pupil_interval_mm_ = zeros_mm.array() - zero_mm;
      if (std::abs(zero_mm) < kPartOfSigma * law.offset_mm.sigma) break;
    }
    return focus;
  }

  // zf by a source, [D5] with the slope f1 f2/(xf - f2)^2. Nothing is in focus where the sensor is
  // nearer than the focal length.
  model::Estimate FocusDepthOf(const Focus& focus) const {
    const double beyond_mm = focus.distance_mm.value - lens_.rear_focal_length_mm;
    if (!(beyond_mm > 0)) return {std::numeric_limits<double>::infinity(), 0};
    const double f1_mm = lens_.front_focal_length_mm;
    return {f1_mm * focus.distance_mm.value / beyond_mm,
            f1_mm * lens_.rear_focal_length_mm / (beyond_mm * beyond_mm) * ErrorMm(focus)};
  }

  // Another source beside the one that is used. It contradicts it beyond the errors of both.
  void Compare(const Focus& other) {
    const double apart_mm = other.distance_mm.value - focus_.distance_mm.value;
    const double both_mm = std::hypot(ErrorMm(other), ErrorMm(focus_));
    constexpr double kSmallest = 1e-3;  // of xf
    const bool agrees =
        !(std::abs(apart_mm) > kGainDiffers * both_mm + kSmallest * focus_.distance_mm.value);
    compared_.push_back({other.from, FocusDepthOf(other), agrees});
    if (agrees) return;
    contradictions_.push_back(other.distance_mm.value +
                              std::copysign(kReach * other.distance_mm.sigma, apart_mm));
    warnings_.push_back(fmt::format(
        "{} puts the sensor {:.5g} +- {:.2g} mm behind the lens at focus, {:+.3g} mm from that by "
        "{}: one of them, the focal length, the unit of the readings or moves: {} is wrong",
        other.from, other.distance_mm.value, ErrorMm(other), apart_mm, focus_.from,
        model::SweepMotionName(moves_)));
  }

  std::optional<std::string> ReasonAgainst(const FocusMotion& motion) const {
    if (motion.blur_per_scale() != 0 && std::abs(motion.blur_per_scale()) > kMinGrowth)
      return std::nullopt;
    return fmt::format(
        "at a magnification of {:.3g} a lens that moves does not change the focus: at 1:1 object "
        "and image distance change alike. Move the target or the sensor, or use another "
        "magnification",
        model::MagnificationAtFocus(lens_, motion.FocusDepthMm()));
  }

  // ---- the equivalent sweep ----
  FocusSweep EquivalentSweep(const FocusMotion& motion) const {
    FocusSweep equivalent = sweep_;
    equivalent.camera.lens = motion.EquivalentLens();
    equivalent.camera.objective.reset();
    // The tolerances of the lens's lengths act on the conversion, not on the equivalent lens.
    for (auto it = equivalent.camera.statements.begin();
         it != equivalent.camera.statements.end();) {
      const bool is_of_lens = it->first.rfind("lens.", 0) == 0;
      it = is_of_lens && it->first != "lens.aperture_radius_mm"
               ? equivalent.camera.statements.erase(it)
               : std::next(it);
    }
    equivalent.direction = model::BenchDirection::kAway;
    equivalent.moves = moves_;
    equivalent.readings_are_focus_distances = false;
    equivalent.stated_focus.clear();
    equivalent.target_period_mm.reset();
    // z' does not depend on xf to first order: its zero is exact, and xf is known apart from it.
    equivalent.offset_mm = model::Estimate{0, 0};
    equivalent.shown_unit = sweep_.readings_are_focus_distances ? model::kDioptreUnit
                            : sweep_.shown_reading              ? sweep_.shown_unit
                                                                : std::string("mm");
    equivalent.shown_reading = [motion, own = sweep_.shown_reading,
                                in_dioptres =
                                    sweep_.readings_are_focus_distances](double depth_mm) {
      const double reading_mm =
          motion.ReadingAt(depth_mm).value_or(std::numeric_limits<double>::quiet_NaN());
      if (in_dioptres) return kMmPerMetre / reading_mm;
      return own ? own(reading_mm) : reading_mm;
    };
    for (model::SweepFrame& frame : equivalent.frames) {
      const auto depth_mm = motion.EquivalentDepthMm(frame.reading_mm);
      // A frame whose blur is beyond that of any depth is as far away as a depth can be.
      frame.reading_mm = depth_mm.value_or(kFarthest * motion.unit_mm());
    }
    if (sweep_.readings_are_focus_distances)
      equivalent.reading_sigma_mm *=
          std::abs(model::ImageDistanceSlope(lens_, motion.FocusDepthMm()));
    return equivalent;
  }

  std::optional<double> FocusReading(const Calibration& found, const FocusMotion& motion) const {
    if (!found.diagnostics.focus_reading_mm) return std::nullopt;
    return motion.ReadingAt(found.diagnostics.focus_reading_mm->value);
  }

  Calibration Converted(Calibration found, const FocusMotion& motion) {
    FocusOrigin origin;
    origin.from = focus_.from;
    origin.stated = focus_.stated;
    if (focus_.from == kFromScale) origin.pupil_interval_mm = pupil_interval_mm_;
    origin.sensor_distance_mm = focus_.distance_mm;
    origin.contradicting_mm = contradictions_;
    origin.compared = compared_;
    ConvertResults(sweep_, moves_, motion, origin, &found);
    found.summary.warnings.insert(found.summary.warnings.begin(), warnings_.begin(),
                                  warnings_.end());
    return Finished(std::move(found));
  }

  static constexpr double kMmPerMetre = 1000;
  static constexpr double kFarthest = 100;  // of u

  const FocusSweep& sweep_;
  const model::ThickLens& lens_;
  model::SweepMotion moves_;
  double sign_;
  const TargetCalibration& target_;
  SweepPreview preview_;
  double focus_reading_mm_ = 0;
  Focus focus_;
  MovingScale scale_;
  std::vector<std::string> warnings_;
  std::vector<double> contradictions_;
  std::vector<ComparedFocus> compared_;
  Eigen::Vector2d pupil_interval_mm_{0, 0};
};

}  // namespace

Calibration CalibrateMovingFocus(const FocusSweep& sweep, model::SweepMotion moves,
                                 const TargetCalibration& target) {
  return MovingFocus(sweep, moves, target).Run();
}

}  // namespace thicklens::calib
