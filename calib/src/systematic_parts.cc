#include "systematic_parts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace thicklens::calib {
namespace {

constexpr std::size_t kFewestFrames = 5;
constexpr std::size_t kFewestOnASide = 6;
constexpr double kSidesDisagree = 3;  // of their standard deviations
// What the meters themselves are good for, relative to kappa: measured on simulated sweeps.
constexpr double kMeterRatioError = 0.003;

// A choice that was tried: what it is called, the fit with it, and the lens that it is for.
struct Trial {
  BlurFitResult fit;
  model::ThickLens lens;
};

std::string SideInWords(const SideFit& side) {
  return side.done ? fmt::format("{} frames", side.frames_used) : side.message;
}

double Width(const Eigen::Vector2d& interval) { return interval.y() - interval.x(); }

// The largest part first; then what takes the largest share of the error of d1, the statistical
// part at its 95 %, what the bench zero brings into it apart.
void SortAndAdvise(Calibration* calibration) {
  std::vector<SystematicPart>& parts = calibration->systematic_parts;
  std::stable_sort(parts.begin(), parts.end(),
                   [](const SystematicPart& a, const SystematicPart& b) {
                     return Width(a.image_distance_mm) > Width(b.image_distance_mm);
                   });
  const double zf_sigma_mm = calibration->focus_depth_mm->sigma;
  const double zero_sigma_mm = std::min(calibration->bench_offset_mm->sigma, zf_sigma_mm);
  const double d1_per_zf =
      zf_sigma_mm > 0 ? calibration->image_distance_mm->sigma / zf_sigma_mm : 0;
  const double zero_mm = 2 * 1.96 * d1_per_zf * zero_sigma_mm;
  const double noise_mm =
      2 * 1.96 * d1_per_zf * std::sqrt(zf_sigma_mm * zf_sigma_mm - zero_sigma_mm * zero_sigma_mm);
  double all_mm = noise_mm + zero_mm;
  for (const SystematicPart& part : parts) all_mm += Width(part.image_distance_mm);
  if (!(all_mm > 0)) return;
  const double worst_mm = parts.empty() ? 0 : Width(parts.front().image_distance_mm);
  const auto share = [&](double part_mm) { return 100 * part_mm / all_mm; };
  if (worst_mm > noise_mm && worst_mm > zero_mm) {
    calibration->advice = fmt::format("{} is {:.0f} % of the error of d1: {}", parts.front().name,
                                      share(worst_mm), parts.front().remedy);
  } else if (zero_mm > noise_mm) {
    calibration->advice = fmt::format(
        "the bench zero is {:.0f} % of the error of d1: measure offset_mm, or sweep over "
        "a longer range so that the image scale shows it better",
        share(zero_mm));
  } else {
    calibration->advice = fmt::format(
        "noise and readings are {:.0f} % of the error of d1: more frames, or a finer bench scale",
        share(noise_mm));
  }
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
    AddShape();
    AddMeter();
    AddTolerances();
    SystematicPart own;
    own.name = "blur meter";
    own.blur_ratio = kMeterRatioError * fit_.values[kBlurRatio] * Eigen::Vector2d(-1, 1);
    own.remedy = "nothing: it is what the meter itself is good for";
    result_.systematic_parts.push_back(own);
    SetIntervals(floor);
    SortAndAdvise(&result_);
  }

 private:
  // Widens a part by a trial's answer.
  void Include(const Trial& trial, SystematicPart* part) const {
    if (!trial.fit.done) return;
    const auto widen = [](double move, Eigen::Vector2d* interval) {
      *interval = {std::min(interval->x(), move), std::max(interval->y(), move)};
    };
    const double zf = trial.fit.values[kFocusDepth];
    widen(zf - fit_.values[kFocusDepth], &part->focus_depth_mm);
    widen(model::ImageDistanceMm(trial.lens, zf) - d1_mm_, &part->image_distance_mm);
    widen(trial.fit.values[kBlurRatio] - fit_.values[kBlurRatio], &part->blur_ratio);
  }

  Trial Try(const BlurFitSetup& setup) const { return {FitBlur(setup, &fit_), setup.lens}; }

  void AddFloor(const FloorInterval& floor) {
    if (!floor) return;
    SystematicPart part;
    part.name = "lens floor";
    part.remedy =
        "photograph a knife edge (target: knife-edge) with the same lens and state "
        "blur_floor_px: {from_calibration: ...}";
    for (const double end_px2 : {floor->x(), floor->y()}) {
      BlurFitSetup setup = evidence_.setup;
      setup.floor_variance_px2 = model::Estimate{end_px2, 0};
      Include(Try(setup), &part);
    }
    result_.systematic_parts.push_back(part);
  }

  // Only where the two sides contradict each other.
  void AddSides() {
    const SideFit& nearer = result_.nearer;
    const SideFit& farther = result_.farther;
    if (!nearer.done || !farther.done) {
      result_.warnings.push_back(
          fmt::format("the two sides of focus cannot be compared (nearer: {}; farther: {}): a lens "
                      "that blurs differently on them would not be noticed",
                      SideInWords(nearer), SideInWords(farther)));
      return;
    }
    const double apart_mm = nearer.focus_depth_mm.value - farther.focus_depth_mm.value;
    const double sigma_mm = std::hypot(nearer.focus_depth_mm.sigma, farther.focus_depth_mm.sigma);
    if (!(std::abs(apart_mm) > kSidesDisagree * sigma_mm)) return;
    result_.warnings.push_back(fmt::format(
        "the two sides of focus disagree: the nearer frames alone give {:.2f} +- {:.2f} mm, "
        "the farther ones {:.2f} +- {:.2f} mm",
        nearer.focus_depth_mm.value, nearer.focus_depth_mm.sigma, farther.focus_depth_mm.value,
        farther.focus_depth_mm.sigma));
    SystematicPart part;
    part.name = "side of focus";
    part.remedy =
        "use frames closer to focus, or a lens with less spherical aberration: one blur "
        "law does not describe both sides";
    for (const SideFit* side : {&nearer, &farther}) {
      BlurFitResult as_fit;
      as_fit.done = true;
      as_fit.values = fit_.values;
      as_fit.values[kFocusDepth] = side->focus_depth_mm.value;
      as_fit.values[kBlurRatio] = side->blur_ratio.value;
      Include({as_fit, evidence_.setup.lens}, &part);
    }
    result_.systematic_parts.push_back(part);
  }

  // Another set of samples in the spectral meter's place. Frames that were thrown out stay out.
  std::optional<Trial> WithSpectrum(const std::optional<BlurSamples>& samples) const {
    if (!samples || evidence_.spectrum < 0) return std::nullopt;
    BlurFitSetup setup = evidence_.setup;
    BlurSamples& place = setup.meters[static_cast<std::size_t>(evidence_.spectrum)];
    std::vector<Eigen::Index> kept;
    for (std::size_t i = 0; i < samples->frames.size(); ++i) {
      if (std::find(place.frames.begin(), place.frames.end(), samples->frames[i]) !=
          place.frames.end())
        kept.push_back(static_cast<Eigen::Index>(i));
    }
    if (kept.size() < kFewestFrames) return std::nullopt;
    BlurSamples chosen;
    chosen.variances_px2 = samples->variances_px2(kept);
    chosen.covariance = samples->covariance(kept, kept);
    for (const Eigen::Index i : kept)
      chosen.frames.push_back(samples->frames[static_cast<std::size_t>(i)]);
    place = std::move(chosen);
    return Try(setup);
  }

  void AddBand() {
    const std::optional<Trial> trial = WithSpectrum(evidence_.narrow_band);
    if (!trial) return;
    SystematicPart part;
    part.name = "frequency band";
    part.remedy = "a target with finer texture, or steps closer to focus";
    Include(*trial, &part);
    result_.systematic_parts.push_back(part);
  }

  // Kappa means another thing with another shape: only the depth moves.
  void AddShape() {
    const std::optional<Trial> trial = WithSpectrum(evidence_.other_psf);
    if (!trial) return;
    SystematicPart part;
    part.name = "shape of the blur";
    part.remedy = evidence_.better_psf == sweep_.camera.psf
                      ? std::string("nothing: the shape that the camera file states fits better")
                      : fmt::format("state psf: {} in the camera file: it fits better",
                                    model::PsfName(evidence_.better_psf));
    Include(*trial, &part);
    part.blur_ratio.setZero();
    result_.systematic_parts.push_back(part);
  }

  // Each meter alone, where there are two.
  void AddMeter() {
    if (evidence_.setup.meters.size() < 2) return;
    SystematicPart part;
    part.name = "edges against texture";
    part.remedy = "check that edge and texture lie in one plane";
    for (std::size_t m = 0; m < evidence_.setup.meters.size(); ++m) {
      BlurFitSetup setup = evidence_.setup;
      setup.meters = {evidence_.setup.meters[m]};
      // What one meter says of the floor holds for the other too.
      if (!setup.floor_variance_px2)
        setup.floor_variance_px2 = model::Estimate{fit_.values[kFloorVariance], 0};
      Include(Try(setup), &part);
    }
    result_.systematic_parts.push_back(part);
  }

  // The numbers of the camera file that state a tolerance.
  void AddTolerances() {
    for (const auto& [field, statement] : sweep_.camera.statements) {
      if (!(statement.tolerance > 0)) continue;
      SystematicPart part;
      part.name = field;
      part.remedy = fmt::format("measure {} better than +- {:.3g}", field, statement.tolerance);
      bool is_used = false;
      for (const double change : {-statement.tolerance, statement.tolerance}) {
        BlurFitSetup setup = evidence_.setup;
        if (!Change(field, change, &setup)) continue;
        is_used = true;
        Include(Try(setup), &part);
      }
      if (is_used) result_.systematic_parts.push_back(part);
    }
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
    return setup->lens.IsValid(nullptr) && setup->pixel_pitch_mm > 0;
  }

  // The floor's ends are as likely as its middle, so they add; the rest adds in quadrature.
  void SetIntervals(const FloorInterval& floor) {
    const auto total = [&](Eigen::Vector2d SystematicPart::*of) {
      Eigen::Vector2d ends(0, 0), squares(0, 0);
      for (const SystematicPart& part : result_.systematic_parts) {
        if (floor && part.name == "lens floor") {
          ends += part.*of;
        } else {
          squares += (part.*of).cwiseAbs2();
        }
      }
      return Eigen::Vector2d(ends.x() - std::sqrt(squares.x()), ends.y() + std::sqrt(squares.y()));
    };
    const auto set = [](std::optional<Result>* result, const Eigen::Vector2d& moves) {
      (*result)->systematic = moves.array() + (*result)->value;
    };
    set(&result_.focus_depth_mm, total(&SystematicPart::focus_depth_mm));
    set(&result_.image_distance_mm, total(&SystematicPart::image_distance_mm));
    set(&result_.blur_ratio, total(&SystematicPart::blur_ratio));
  }

  const FocusSweep& sweep_;
  const BlurEvidence& evidence_;
  const BlurFitResult& fit_;
  Calibration& result_;
  double d1_mm_ = 0;
};

// The samples on one side of focus, the target's softness held as the whole sweep has it.
std::optional<BlurFitSetup> SideOf(const BlurEvidence& evidence, const BlurFitResult& fit,
                                   bool nearer, std::size_t* frames) {
  BlurFitSetup setup = evidence.setup;
  setup.offset_mm.sigma = 0;  // moves both sides alike
  if (!setup.floor_variance_px2)
    setup.floor_variance_px2 = model::Estimate{fit.values[kFloorVariance], 0};
  *frames = 0;
  for (std::size_t m = 0; m < setup.meters.size(); ++m) {
    BlurSamples& meter = setup.meters[m];
    std::vector<Eigen::Index> kept;
    std::vector<std::size_t> kept_frames;
    for (std::size_t i = 0; i < meter.frames.size(); ++i) {
      const double depth_mm = setup.offset_mm.value + model::DirectionSign(setup.direction) *
                                                          setup.frames[meter.frames[i]].reading_mm;
      if ((depth_mm < fit.values[kFocusDepth]) != nearer) continue;
      kept.push_back(static_cast<Eigen::Index>(i));
      kept_frames.push_back(meter.frames[i]);
    }
    BlurSamples side;
    side.frames = kept_frames;
    side.variances_px2 = meter.variances_px2(kept);
    side.covariance = meter.covariance(kept, kept);
    side.held_softness_px2 = fit.softness_px2[m];
    meter = std::move(side);
    *frames = std::max(*frames, kept.size());
  }
  setup.meters.erase(std::remove_if(setup.meters.begin(), setup.meters.end(),
                                    [](const BlurSamples& m) { return m.frames.empty(); }),
                     setup.meters.end());
  if (*frames < kFewestOnASide) return std::nullopt;
  return setup;
}

SideFit FitSide(const BlurEvidence& evidence, const BlurFitResult& fit, bool nearer) {
  SideFit side;
  std::size_t frames = 0;
  const std::optional<BlurFitSetup> setup = SideOf(evidence, fit, nearer, &frames);
  side.frames_used = static_cast<int>(frames);
  if (!setup) {
    side.message = fmt::format("{} frames on this side, {} are needed", frames, kFewestOnASide);
    return side;
  }
  const BlurFitResult alone = FitBlur(*setup, &fit);
  side.message = alone.message;
  if (!alone.done) return side;
  side.done = true;
  side.focus_depth_mm = {alone.values[kFocusDepth],
                         std::sqrt(alone.covariance(kFocusDepth, kFocusDepth))};
  side.blur_ratio = {alone.values[kBlurRatio], std::sqrt(alone.covariance(kBlurRatio, kBlurRatio))};
  return side;
}

}  // namespace

void FitSides(const BlurEvidence& evidence, const BlurFitResult& fit, Calibration* calibration) {
  calibration->nearer = FitSide(evidence, fit, true);
  calibration->farther = FitSide(evidence, fit, false);
}

void AddSystematicParts(const FocusSweep& sweep, const BlurEvidence& evidence,
                        const BlurFitResult& fit, const FloorInterval& floor,
                        Calibration* calibration) {
  Parts(sweep, evidence, fit, calibration).Run(floor);
}

void WidenFocus(const std::string& name, double move_mm, const std::string& remedy,
                const model::ThickLens& lens, Calibration* calibration) {
  const double zf = calibration->focus_depth_mm->value;
  const double d1_mm = model::ImageDistanceMm(lens, zf);
  SystematicPart part;
  part.name = name;
  part.remedy = remedy;
  // d1 falls as zf grows; nearer than the focal point nothing comes into focus.
  const double nearest_mm = std::max(zf - move_mm, std::min(zf, 1.01 * lens.front_focal_length_mm));
  part.focus_depth_mm = {nearest_mm - zf, move_mm};
  part.image_distance_mm = {model::ImageDistanceMm(lens, zf + move_mm) - d1_mm,
                            model::ImageDistanceMm(lens, nearest_mm) - d1_mm};
  if (calibration->focus_depth_mm->systematic)
    *calibration->focus_depth_mm->systematic += part.focus_depth_mm;
  if (calibration->image_distance_mm->systematic)
    *calibration->image_distance_mm->systematic += part.image_distance_mm;
  calibration->systematic_parts.push_back(part);
  SortAndAdvise(calibration);
}

}  // namespace thicklens::calib
