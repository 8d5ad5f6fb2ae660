#include "calib/uncertainty/systematic_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "calib/fit/blur_tails.h"
#include "calib/fit/known_focus.h"
#include "calib/fit/pupil_shapes.h"
#include "calib/uncertainty/systematic_advice.h"

namespace thicklens::calib {
namespace {

constexpr std::size_t kMinFrames = 5;
constexpr double kShapesDiffer = 1.1;  // ratio of chi^2 of the frames
// Difference of chi^2 of the frames, 4 standard deviations, beyond which a family is ruled out.
constexpr double kRuledOut = 16;
constexpr double kModelFails = 2;     // chi^2 per degree of freedom of the blur law
constexpr double kSidesDisagree = 3;  // times their standard deviations
// Accuracy of the estimators themselves, relative to kappa: measured on simulated sweeps.
constexpr double kEstimatorRatioError = 0.003;

// An alternative choice: the fit with it, and the lens that it is for.
struct Trial {
  BlurFitResult fit;
  model::ThickLens lens;
};

std::string SideInWords(const SideFit& side) {
  return side.done ? fmt::format("{} frames", side.frames_used) : side.message;
}

class Parts {
 public:
  Parts(const FocusSweep& sweep, const BlurEvidence& evidence, const BlurFitResult& fit,
        Calibration* calibration)
      : sweep_(sweep), evidence_(evidence), fit_(fit), result_(*calibration) {
    d1_mm_ = model::ImageDistanceMm(evidence.setup.lens, fit.values[kFocusDepth]);
  }

  void Run(const FloorInterval& floor) {
    AddFloor(floor);
    AddSides();
    AddBand();
    AddContrast();
    AddShape();
    AddTails();
    AddEstimator();
    AddTolerances();
    AddAssumedTolerance();
    AddMagnificationOfObjective();
    SystematicPart own;
    own.name = "blur estimator";
    own.blur_ratio = kEstimatorRatioError * fit_.values[kBlurRatio] * Eigen::Vector2d(-1, 1);
    own.remedy = "no remedy: this is the accuracy of the blur estimator itself";
    result_.diagnostics.systematic_parts.push_back(own);
    SetIntervals(floor);
    SortAndAdvise(&result_);
  }

 private:
  // Widens a part by a trial's result.
  void Include(const Trial& trial, SystematicPart* part) {
    if (!trial.fit.done) return;
    const auto widen = [](double move, Eigen::Vector2d* interval) {
      *interval = {std::min(interval->x(), move), std::max(interval->y(), move)};
    };
    const double zf = trial.fit.values[kFocusDepth];
    widen(zf - fit_.values[kFocusDepth], &part->focus_depth_mm);
    widen(model::ImageDistanceMm(trial.lens, zf) - d1_mm_, &part->image_distance_mm);
    widen(trial.fit.values[kBlurRatio] - fit_.values[kBlurRatio], &part->blur_ratio);
    widen(trial.fit.values[kBenchOffset] - fit_.values[kBenchOffset], &OffsetMoves(part->name));
  }

  Eigen::Vector2d& OffsetMoves(const std::string& part) {
    return offset_moves_mm_.try_emplace(part, Eigen::Vector2d::Zero()).first->second;
  }

  Trial Try(const BlurFitSetup& setup) const { return TryAt(evidence_.known_focus, setup); }

  Trial TryAt(std::optional<model::StatedConjugate> known, const BlurFitSetup& setup) const {
    // A magnification from the period of the target is in proportion to the pixel pitch.
    if (known && known->name == kFromPeriod)
      known->value.value *= setup.pixel_pitch_mm / evidence_.setup.pixel_pitch_mm;
    return {FitBlurWith(setup, known, &fit_), setup.lens};
  }

  // Includes a trial of a number of the camera file; one that fails must not pass for one without
  // an effect.
  void IncludeOrWarn(const Trial& trial, SystematicPart* part) {
    if (!trial.fit.done) {
      result_.summary.warnings.push_back(
          fmt::format("{}: the fit at an end of its tolerance failed, and the intervals do not "
                      "include it ({})",
                      part->name, trial.fit.message));
    }
    Include(trial, part);
  }

  void AddFloor(const FloorInterval& floor) {
    if (!floor) return;
    SystematicPart part;
    part.name = "blur floor";
    part.remedy =
        "photograph a knife edge (target: knife-edge) with the same lens and state "
        "blur_floor_px: {from_calibration: ...}";
    for (const double end_px2 : {floor->x(), floor->y()}) {
      BlurFitSetup setup = evidence_.setup;
      setup.floor_variance_px2 = model::Estimate{end_px2, 0};
      Include(Try(setup), &part);
    }
    result_.diagnostics.systematic_parts.push_back(part);
  }

  // Adds a part only where the two sides contradict each other.
  void AddSides() {
    const SideFit& nearer = result_.diagnostics.nearer;
    const SideFit& farther = result_.diagnostics.farther;
    if (!nearer.done || !farther.done) {
      result_.summary.warnings.push_back(
          fmt::format("the two sides of focus cannot be compared (nearer: {}; farther: {}): a lens "
                      "that blurs differently on the two sides would not be noticed",
                      SideInWords(nearer), SideInWords(farther)));
      return;
    }
    const double apart_mm = nearer.focus_depth_mm.value - farther.focus_depth_mm.value;
    const double sigma_mm = std::hypot(nearer.focus_depth_mm.sigma, farther.focus_depth_mm.sigma);
    if (!(std::abs(apart_mm) > kSidesDisagree * sigma_mm)) return;
    // Where the lens or the sensor moves, these depths are those of the equivalent target.
    result_.summary.warnings.push_back(
        sweep_.moves && model::MovesFocus(*sweep_.moves)
            ? fmt::format("the two sides of focus disagree: their readings at focus differ by "
                          "{:.2g} +- {:.2g} mm",
                          std::abs(apart_mm), sigma_mm)
            : fmt::format("the two sides of focus disagree: the nearer frames alone give {:.2f} +- "
                          "{:.2g} mm, "
                          "the farther ones {:.2f} +- {:.2g} mm",
                          nearer.focus_depth_mm.value, nearer.focus_depth_mm.sigma,
                          farther.focus_depth_mm.value, farther.focus_depth_mm.sigma));
    SystematicPart part;
    part.name = "side of focus";
    part.remedy =
        "use frames closer to focus: one blur law does not describe both sides (possible causes "
        "are spherical aberration, a wrong sensor.transfer, or light that changes along the bench)";
    for (const SideFit* side : {&nearer, &farther}) {
      BlurFitResult as_fit;
      as_fit.done = true;
      as_fit.values = fit_.values;
      as_fit.values[kFocusDepth] = side->focus_depth_mm.value;
      as_fit.values[kBlurRatio] = side->blur_ratio.value;
      Include({as_fit, evidence_.setup.lens}, &part);
    }
    result_.diagnostics.systematic_parts.push_back(part);
  }

  // Fits with other samples in place of an estimator's. Rejected frames remain excluded.
  std::optional<Trial> With(const std::optional<BlurSamples>& samples, int estimator) const {
    if (!samples || estimator < 0) return std::nullopt;
    BlurFitSetup setup = evidence_.setup;
    BlurSamples& place = setup.estimators[static_cast<std::size_t>(estimator)];
    std::vector<Eigen::Index> kept;
    for (std::size_t i = 0; i < samples->frames.size(); ++i) {
      if (std::find(place.frames.begin(), place.frames.end(), samples->frames[i]) !=
          place.frames.end())
        kept.push_back(static_cast<Eigen::Index>(i));
    }
    if (kept.size() < kMinFrames) return std::nullopt;
    BlurSamples chosen;
    chosen.held_softness_px2 = place.held_softness_px2;
    chosen.variances_px2 = samples->variances_px2(kept);
    chosen.covariance = samples->covariance(kept, kept);
    for (const Eigen::Index i : kept)
      chosen.frames.push_back(samples->frames[static_cast<std::size_t>(i)]);
    place = std::move(chosen);
    return Try(setup);
  }

  void AddBand() {
    const std::optional<Trial> trial = With(evidence_.narrow_band, evidence_.spectrum);
    if (!trial) return;
    SystematicPart part;
    part.name = "frequency band";
    part.remedy = "use a target with finer texture, or steps closer to focus";
    Include(*trial, &part);
    result_.diagnostics.systematic_parts.push_back(part);
  }

  // Adds the effect of a loss of contrast at all frequencies, which held gains take for blur.
  void AddContrast() {
    if (!evidence_.axial) return;
    const std::optional<Trial> trial = With(evidence_.axial->free_gains, evidence_.spectrum);
    if (!trial) return;
    SystematicPart part;
    part.name = "contrast of the blur's halo";
    part.remedy =
        "use frames closer to focus or a smaller aperture: neither blur shape fits, and the frames "
        "lose contrast at all frequencies alike";
    Include(*trial, &part);
    result_.diagnostics.systematic_parts.push_back(part);
  }

  // Whether the other shape is right beyond doubt: the frames themselves show it, or the law holds
  // with it and not with the stated one.
  bool OtherShapeIsRight(const Trial& other) const {
    if (!other.fit.done) return false;
    if (evidence_.gaussian_misfit && evidence_.disc_misfit) {
      const bool is_gaussian = sweep_.camera.psf == model::Psf::kGaussian;
      const double stated = is_gaussian ? *evidence_.gaussian_misfit : *evidence_.disc_misfit;
      const double better = is_gaussian ? *evidence_.disc_misfit : *evidence_.gaussian_misfit;
      if (stated > kShapesDiffer * better) return true;
    }
    return evidence_.better_psf != sweep_.camera.psf && fit_.chi2_per_dof > kModelFails &&
           fit_.chi2_per_dof > 2 * other.fit.chi2_per_dof;
  }

  // Whether the stated family describes the frames better beyond doubt. Another family's kappa is
  // then meaningless: it is the second moment of a shape that the blur does not have.
  bool OtherShapeIsRuledOut() const {
    if (!evidence_.gaussian_misfit || !evidence_.disc_misfit) return false;
    const bool is_gaussian = sweep_.camera.psf == model::Psf::kGaussian;
    const double stated = is_gaussian ? *evidence_.gaussian_misfit : *evidence_.disc_misfit;
    const double other = is_gaussian ? *evidence_.disc_misfit : *evidence_.gaussian_misfit;
    if (evidence_.shape_dof > 0) return (other / stated - 1) * evidence_.shape_dof > kRuledOut;
    return other > kShapesDiffer * stated;
  }

  // Whether the other family describes the frames better by more than chance does.
  bool OtherShapeFitsMarkedly() const {
    if (!evidence_.gaussian_misfit || !evidence_.disc_misfit) return false;
    const bool is_gaussian = sweep_.camera.psf == model::Psf::kGaussian;
    const double stated = is_gaussian ? *evidence_.gaussian_misfit : *evidence_.disc_misfit;
    const double other = is_gaussian ? *evidence_.disc_misfit : *evidence_.gaussian_misfit;
    if (evidence_.shape_dof > 0) return (stated / other - 1) * evidence_.shape_dof > kRuledOut;
    return stated > kShapesDiffer * other;
  }

  bool NeitherShapeFits() const {
    return evidence_.gaussian_misfit && evidence_.disc_misfit &&
           std::min(*evidence_.gaussian_misfit, *evidence_.disc_misfit) >= kLargestMisfitOfShape;
  }

  // A better one of two bad descriptions is no reason to state another shape.
  std::string RemedyOfShape(bool other_is_right) const {
    if (NeitherShapeFits()) {
      return fmt::format(
          "neither blur shape fits the frames (misfit {:.3g} for gaussian, {:.3g} for disc, 1 is "
          "expected): "
          "check sensor.transfer in the camera file, sharpening or denoising in the camera, and "
          "aberrations of the lens, none of which these frames exclude",
          *evidence_.gaussian_misfit, *evidence_.disc_misfit);
    }
    if (other_is_right || OtherShapeFitsMarkedly()) {
      return fmt::format("state psf: {} in the camera file: this shape fits better",
                         model::PsfName(OtherPsf(sweep_.camera.psf)));
    }
    return evidence_.better_psf == sweep_.camera.psf
               ? "no remedy: the shape that the camera file states fits better"
               : "no remedy: both shapes fit about equally well";
  }

  // Adds the spread over the families that the frames do not rule out. The depth is compared in any
  // case.
  void AddShape() {
    const std::optional<Trial> trial =
        With(evidence_.other_psf, evidence_.spectrum >= 0 ? evidence_.spectrum : evidence_.edges);
    if (!trial) return;
    SystematicPart part;
    part.name = kShapePart;
    const bool is_right = OtherShapeIsRight(*trial);
    const model::Psf other = OtherPsf(sweep_.camera.psf);
    part.remedy = RemedyOfShape(is_right);
    Include(*trial, &part);
    if (!is_right && OtherShapeIsRuledOut()) part.blur_ratio.setZero();
    result_.diagnostics.systematic_parts.push_back(part);
    if (!is_right || NeitherShapeFits()) return;
    result_.summary.warnings.push_back(fmt::format(
        "the blur is a {}, not the {} that the camera file states: with it the frames "
        "follow the blur law (chi2/dof {:.3g} against {:.3g}) and the blur ratio is "
        "{:.4f}; state psf: {} in the camera file",
        model::PsfName(other), model::PsfName(sweep_.camera.psf), trial->fit.chi2_per_dof,
        fit_.chi2_per_dof, trial->fit.values[kBlurRatio], model::PsfName(other)));
  }

  // Adds the effect of the blur's tails, in which pupil laws differ, on its second moment.
  void AddTails() {
    const double kappa = fit_.values[kBlurRatio];
    const double zf_mm = fit_.values[kFocusDepth];
    if (!(kappa > 0) || !(zf_mm > evidence_.setup.lens.front_focal_length_mm)) return;
    const model::PupilOptics optics =
        model::PupilOpticsOf(evidence_.setup.lens, sweep_.camera.psf, kappa, zf_mm);
    SystematicPart part;
    part.name = "tails of the blur";
    part.remedy =
        "use a smaller aperture: the distribution of light over the pupil of a wide aperture is "
        "not known well enough";
    if (const auto range = TailsLeft(sweep_.camera.psf, fit_, evidence_)) {
      for (const double tails : {range->x(), range->y()}) {
        if (tails == 0) continue;
        BlurSamples moved = FitSamples(evidence_, evidence_.blur, evidence_.region);
        moved.variances_px2 += tails * evidence_.blur.variance_by_tails;
        if (const auto trial = With(moved, evidence_.spectrum)) Include(*trial, &part);
      }
    }
    const bool is_possible = optics.sigma_mm <= model::kWidestPupil * optics.image_distance_mm;
    // The second moment of a point's image does not depend on the law.
    if (evidence_.edges >= 0 && !evidence_.by_points && is_possible) {
      const Eigen::Vector2d ratios = EdgeRatiosOfPupilLaws(optics);
      part.blur_ratio.x() = std::min(part.blur_ratio.x(), kappa * (1 / ratios.y() - 1));
      part.blur_ratio.y() = std::max(part.blur_ratio.y(), kappa * (1 / ratios.x() - 1));
    }
    if (part.blur_ratio.isZero() && part.focus_depth_mm.isZero()) return;
    result_.diagnostics.systematic_parts.push_back(part);
  }

  // Tries each estimator alone, where there are two.
  void AddEstimator() {
    if (evidence_.setup.estimators.size() < 2) return;
    SystematicPart part;
    part.name = "edges against texture";
    part.remedy = "check that edge and texture lie in one plane";
    for (std::size_t m = 0; m < evidence_.setup.estimators.size(); ++m) {
      BlurFitSetup setup = evidence_.setup;
      setup.estimators = {evidence_.setup.estimators[m]};
      // The floor that one estimator determines also holds for the other.
      if (!setup.floor_variance_px2)
        setup.floor_variance_px2 = model::Estimate{fit_.values[kFloorVariance], 0};
      Include(Try(setup), &part);
    }
    result_.diagnostics.systematic_parts.push_back(part);
  }

  // Whether a focal length is that of the other one, whose tolerance counts: where a statement
  // gives zf, they change together.
  bool IsCountedByOther(const std::string& field) const {
    return evidence_.known_focus && field == kRearFocalLength &&
           HasOneFocalLength(evidence_.setup.lens) &&
           FieldOfFocalLengthTolerance(sweep_.camera) != field;
  }

  // Tries the numbers of the camera file that state a tolerance.
  void AddTolerances() {
    for (const auto& [field, statement] : sweep_.camera.statements) {
      if (!(statement.tolerance > 0) || IsCountedByOther(field)) continue;
      SystematicPart part;
      part.name = field;
      part.remedy = fmt::format("measure {} better than +- {:.3g}", field, statement.tolerance);
      bool is_used = false;
      for (const double change : {-statement.tolerance, statement.tolerance}) {
        BlurFitSetup setup = evidence_.setup;
        if (!Change(field, change, &setup)) continue;
        is_used = true;
        IncludeOrWarn(Try(setup), &part);
      }
      if (is_used) result_.diagnostics.systematic_parts.push_back(part);
    }
  }

  // Where a magnification or a distance of the image gives the plane of focus, zf is in proportion
  // to the focal length. Without a stated tolerance, that of labels is tried.
  void AddAssumedTolerance() {
    const auto& known = evidence_.known_focus;
    if (!known || known->kind == model::ConjugateKind::kFocusDepth || sweep_.camera.objective ||
        StatesFocalLength(sweep_.camera))
      return;
    SystematicPart part;
    part.name = kFrontFocalLength;
    part.remedy = fmt::format(
        "state the tolerance of lens.front_focal_length_mm, from which {} gives the in-focus "
        "distance ({:.0f} % is assumed)",
        known->name, 100 * kFocalLengthTolerance);
    for (const double change : {-kFocalLengthTolerance, kFocalLengthTolerance}) {
      BlurFitSetup setup = evidence_.setup;
      setup.lens.front_focal_length_mm *= 1 + change;
      setup.lens.rear_focal_length_mm *= 1 + change;
      IncludeOrWarn(Try(setup), &part);
    }
    result_.diagnostics.systematic_parts.push_back(part);
  }

  // The magnification of an objective gives the plane of focus within its tolerance. The equivalent
  // lens stays as the camera file states it.
  void AddMagnificationOfObjective() {
    const auto& known = evidence_.known_focus;
    const double tolerance = known ? ToleranceOfStatement(sweep_.camera, *known) : 0;
    if (!(tolerance > 0)) return;
    SystematicPart part;
    part.name = kFromObjective;
    part.remedy = fmt::format(
        "measure the magnification (target_period_mm with a stage micrometer in view), or state "
        "lens.magnification with a tolerance smaller than {:.2g}",
        tolerance);
    for (const double change : {-tolerance, tolerance}) {
      model::StatedConjugate moved = *known;
      moved.value.value += change;
      IncludeOrWarn(TryAt(moved, evidence_.setup), &part);
    }
    result_.diagnostics.systematic_parts.push_back(part);
  }

  // Changes a number of the objective's data, and with it the lens. Returns as Change does.
  bool ChangeObjective(const std::string& field, double change, BlurFitSetup* setup) const {
    model::Objective objective = *sweep_.camera.objective;
    // Where the magnification gives the plane of focus, its error is that of the statement
    // (AddMagnificationOfObjective), and would be counted twice.
    const bool is_counted = evidence_.known_focus &&
                            evidence_.known_focus->kind == model::ConjugateKind::kMagnification;
    double* number = field == "lens.numerical_aperture"             ? &objective.numerical_aperture
                     : field == "lens.magnification" && !is_counted ? &objective.magnification
                     : field == "lens.tube_lens_focal_length_mm"
                         ? &objective.tube_lens_focal_length_mm
                         : nullptr;
    if (number == nullptr) return false;
    *number += change;
    if (!objective.IsValid(nullptr)) return false;
    setup->lens = model::LensOfObjective(objective);
    return true;
  }

  // Changes a number of the camera file. Returns false if the fit does not use the number, or if
  // its value is impossible.
  bool Change(const std::string& field, double change, BlurFitSetup* setup) const {
    if (sweep_.camera.objective && field.rfind("lens.", 0) == 0)
      return ChangeObjective(field, change, setup);
    const bool is_front = field == kFrontFocalLength, is_rear = field == kRearFocalLength;
    // A statement gives zf for both focal lengths of a lens in air, which are one length.
    if ((is_front || is_rear) && evidence_.known_focus && HasOneFocalLength(setup->lens)) {
      setup->lens.front_focal_length_mm += change;
      setup->lens.rear_focal_length_mm += change;
      return setup->lens.IsValid(nullptr);
    }
    double* number = is_front                             ? &setup->lens.front_focal_length_mm
                     : is_rear                            ? &setup->lens.rear_focal_length_mm
                     : field == "lens.lens_thickness_mm"  ? &setup->lens.lens_thickness_mm
                     : field == "lens.aperture_radius_mm" ? &setup->lens.aperture_radius_mm
                     : field == "sensor.pixel_pitch_mm"   ? &setup->pixel_pitch_mm
                                                          : nullptr;
    if (number == nullptr) return false;
    *number += change;
    return setup->lens.IsValid(nullptr) && setup->pixel_pitch_mm > 0;
  }

  // The floor's ends are as likely as its middle, so they add linearly; the rest adds in
  // quadrature. A bench offset that follows from the fit moves as well.
  void SetIntervals(const FloorInterval& floor) {
    const auto sum = [&](const auto& of) {
      Eigen::Vector2d ends(0, 0), squares(0, 0);
      for (const SystematicPart& part : result_.diagnostics.systematic_parts) {
        const Eigen::Vector2d moves = of(part);
        if (floor && part.name == "blur floor") {
          ends += moves;
        } else {
          squares += moves.cwiseAbs2();
        }
      }
      return Eigen::Vector2d(ends.x() - std::sqrt(squares.x()), ends.y() + std::sqrt(squares.y()));
    };
    const auto total = [&](Eigen::Vector2d SystematicPart::*of) {
      return sum([of](const SystematicPart& part) { return part.*of; });
    };
    const auto set = [](std::optional<Result>* result, const Eigen::Vector2d& moves) {
      (*result)->systematic = moves.array() + (*result)->value;
    };
    set(&result_.summary.focus_depth_mm, total(&SystematicPart::focus_depth_mm));
    set(&result_.summary.image_distance_mm, total(&SystematicPart::image_distance_mm));
    set(&result_.summary.blur_ratio, total(&SystematicPart::blur_ratio));
    if (evidence_.known_focus && result_.summary.bench_offset_mm)
      set(&result_.summary.bench_offset_mm,
          sum([&](const SystematicPart& part) { return OffsetMoves(part.name); }));
  }

  const FocusSweep& sweep_;
  const BlurEvidence& evidence_;
  const BlurFitResult& fit_;
  Calibration& result_;
  double d1_mm_ = 0;
  // Moves of the bench offset by each part, by its name: of a fit at a known plane of focus.
  std::map<std::string, Eigen::Vector2d> offset_moves_mm_;
};

}  // namespace

void AddSystematicParts(const FocusSweep& sweep, const BlurEvidence& evidence,
                        const BlurFitResult& fit, const FloorInterval& floor,
                        Calibration* calibration) {
  Parts(sweep, evidence, fit, calibration).Run(floor);
}

}  // namespace thicklens::calib
