// Effects of what light meets behind the aperture: diffraction, lens floor, pixels, electronics.
#include <algorithm>
#include <cmath>
#include <vector>

#include "model/effects/effect_bounds.h"
#include "model/optics/airy.h"

namespace thicklens::model {
namespace {

// Of a uniform distribution of width 1.
constexpr double kBoxVariance = 1.0 / 12;

double RoundingStep(const EffectOptics& optics) {
  return 255 / (std::exp2(optics.conditions().bits) - 1);
}

}  // namespace

// Pixel box [D54]. Formula: mean over a square of one px, of variance 1/12 per axis. Bound:
// BlurChange; at a jump, which no box has made a ramp yet, up to 3/4 of it (the tip of a right
// angle has a quarter of its pixel). Enters: where rays land.
EffectImpact PixelBoxImpact(const EffectOptics& optics, const EffectPlace& place,
                            const EffectSet& others) {
  EffectPlace smooth = place;
  smooth.jump = 0;
  const EffectOptics::Smoothing other = optics.SmoothingBy(others, place);
  double change = BlurChange(smooth, kBoxVariance, {}) + 0.75 * place.jump;
  if (other.gaussian_px2 > 0 || other.disc_px > 0) {
    EffectPlace worst = place;
    worst.jump = worst.slope = worst.bend = 1e9;  // only what the blur leaves of it
    change = std::min(change, BlurChange(worst, kBoxVariance, other));
  }
  return {std::sqrt(kBoxVariance),
          StoredChange(optics, place, std::min(change, place.bright - place.dark))};
}

// Lens floor. Formula: a Gaussian of the measured sigma, in quadrature with defocus. Bound:
// BlurChange, and that of diffraction, which comes forth without the floor that holds it. Enters:
// where rays land.
EffectImpact LensFloorImpact(const EffectOptics& optics, const EffectPlace& place,
                             const EffectSet& others) {
  const double floor_px = optics.floor_px();
  if (!(floor_px > 0)) return {};
  const double change = BlurChange(place, floor_px * floor_px, optics.SmoothingBy(others, place));
  const double of_diffraction =
      others.Has(Effect::kDiffraction)
          ? DiffractionImpact(optics, place, others.Without({Effect::kLensFloor})).grey_levels
          : 0;
  return {floor_px, StoredChange(optics, place, change) + of_diffraction};
}

// Diffraction. Formula: airy.h. A lens floor that was measured holds it already: then it is not
// added once more, and its impact is 0. Bound: of the Gaussian BlurChange; of a disc's pattern,
// which has no variance, the mean of min(R, |d| slope) + J min(1, sqrt(2) |d_n|/2) over its
// displacements d; without the box, half of J. Enters: where rays land.
EffectImpact DiffractionImpact(const EffectOptics& optics, const EffectPlace& place,
                               const EffectSet& others) {
  const double radius_px = AiryRadiusPx(optics.camera(), optics.conditions().wavelength_mm);
  if (optics.floor_px() > 0 && others.Has(Effect::kLensFloor)) return {radius_px, 0};
  const double range = place.bright - place.dark;
  if (!optics.is_disc()) {
    const double sigma_px = radius_px / kGaussianAiryRadius;
    const double change = BlurChange(place, sigma_px * sigma_px, optics.SmoothingBy(others, place));
    return {radius_px, StoredChange(optics, place, change)};
  }
  constexpr int kQuantiles = 64;
  static const std::vector<double> airy_radii = AiryQuantiles(kQuantiles);
  constexpr double kMeanOfComponent = 2 / 3.14159265358979323846;  // E|cos| over all directions
  double change = 0;
  for (const double airy_radius : airy_radii) {
    const double distance_px = radius_px * airy_radius;
    const double past_edge =
        others.Has(Effect::kPixelBox) ? std::sqrt(2.0) * distance_px * kMeanOfComponent / 2 : 0.5;
    change += (std::min(range, distance_px * place.slope) + place.jump * std::min(1.0, past_edge)) /
              kQuantiles;
  }
  return {radius_px, StoredChange(optics, place, std::min(range, change))};
}

// Shot noise [D54]. Formula: Poisson of L n electrons, n at full scale: sd sqrt(L/n) in linear
// light. Bound: what that is in stored values, which grows where the transfer curve is straight,
// near black, and falls where it is a power of at most 1/2; looked at where these meet, too.
// Enters: after the picture is formed.
EffectImpact ShotNoiseImpact(const EffectOptics& optics, const EffectPlace& place,
                             const EffectSet& /*others*/) {
  const double full_well = optics.conditions().full_well_electrons;
  if (!(full_well > 0)) return {};
  constexpr double kKnee = 0.0031308;  // of sRGB
  double largest = 0;
  EffectPlace level = place;
  for (const double light : {place.dark, place.bright,
                             std::clamp(kKnee, place.dark, std::max(place.dark, place.bright))}) {
    // Less than one electron is the same as one.
    level.dark = std::max(light, 1 / full_well);
    largest = std::max(largest, StoredSigma(optics, level, std::sqrt(level.dark / full_well)));
  }
  return {largest, largest};
}

// Read noise. Formula: normal, in electrons before the transfer curve or in stored values after
// it. Bound: what the former is in stored values where it is dark; both in quadrature. Enters:
// after the picture is formed.
EffectImpact ReadNoiseImpact(const EffectOptics& optics, const EffectPlace& place,
                             const EffectSet& /*others*/) {
  const EffectConditions& conditions = optics.conditions();
  double sigma = conditions.stored_noise_grey_levels;
  if (conditions.full_well_electrons > 0) {
    sigma = std::hypot(
        sigma, StoredSigma(optics, place,
                           conditions.read_noise_electrons / conditions.full_well_electrons));
  }
  return {sigma, sigma};
}

// Quantisation [D54]. Formula: rounding to 1/(2^bits - 1), an error of standard deviation
// 1/sqrt(12) of that. Enters: last of all.
EffectImpact QuantisationImpact(const EffectOptics& optics, const EffectPlace& /*place*/,
                                const EffectSet& /*others*/) {
  const double sigma = RoundingStep(optics) * std::sqrt(kBoxVariance);
  return {sigma, sigma};
}

// Transfer curve. Formula: IEC 61966-2-1 or a power. Bound: its distance from linear light, which
// is concave: the largest between dark and bright is at its maximum or at the nearer end. Enters:
// after the picture is formed.
EffectImpact TransferCurveImpact(const EffectOptics& optics, const EffectPlace& place,
                                 const EffectSet& /*others*/) {
  const TransferCurve& transfer = optics.camera().sensor.transfer;
  const double dark = std::clamp(place.dark, 0.0, 1.0);
  const double bright = std::clamp(place.bright, dark, 1.0);
  const auto distance = [&](double light) { return transfer.Encode(light) - light; };
  double low = dark, high = bright;
  for (int i = 0; i < 40; ++i) {
    const double left = low + (high - low) / 3, right = high - (high - low) / 3;
    if (distance(left) < distance(right)) {
      low = left;
    } else {
      high = right;
    }
  }
  const double largest = 255 * std::max({std::abs(distance((low + high) / 2)),
                                         std::abs(distance(dark)), std::abs(distance(bright))});
  return {largest, largest};
}

}  // namespace thicklens::model
