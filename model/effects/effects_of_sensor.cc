// Effects behind the aperture: diffraction, blur floor, pixels, electronics.
#include <algorithm>
#include <cmath>
#include <vector>

#include "model/effects/effect_bounds.h"
#include "model/optics/airy.h"

namespace thicklens::model {
namespace {

// Variance of a uniform distribution of width 1.
constexpr double kBoxVariance = 1.0 / 12;

double RoundingStep(const EffectOptics& optics) {
  return 255 / (std::exp2(optics.conditions().bits) - 1);
}

}  // namespace

// Pixel box [D54]. Formula: the mean over a square of one px, whose variance is 1/12 per axis.
// Bound: BlurChange; at a jump, which no box has turned into a ramp yet, up to 3/4 of the jump (the
// tip of a right angle covers a quarter of its pixel). Enters: the landing points of the rays.
EffectImpact PixelBoxImpact(const EffectOptics& optics, const EffectSite& place,
                            const EffectSet& others) {
  EffectSite smooth = place;
  smooth.jump = 0;
  const EffectOptics::Smoothing other = optics.SmoothingBy(others, place);
  double change = BlurChange(smooth, kBoxVariance, {}) + 0.75 * place.jump;
  if (other.gaussian_px2 > 0 || other.disc_px > 0) {
    EffectSite worst = place;
    worst.jump = worst.slope = worst.bend = 1e9;  // only the other blur bounds the change
    change = std::min(change, BlurChange(worst, kBoxVariance, other));
  }
  return {std::sqrt(kBoxVariance),
          EncodedChange(optics, place, std::min(change, place.bright - place.dark))};
}

// Blur floor. Formula: a Gaussian of the measured sigma, in quadrature with defocus. Bound: the sum
// of BlurChange and the bound of diffraction, which appears when the floor that contains it is
// removed. Enters: the landing points of the rays.
EffectImpact LensFloorImpact(const EffectOptics& optics, const EffectSite& place,
                             const EffectSet& others) {
  const double floor_px = optics.floor_px();
  if (!(floor_px > 0)) return {};
  const double change = BlurChange(place, floor_px * floor_px, optics.SmoothingBy(others, place));
  const double of_diffraction =
      others.Has(Effect::kDiffraction)
          ? DiffractionImpact(optics, place, others.Without({Effect::kLensFloor})).grey_levels
          : 0;
  return {floor_px, EncodedChange(optics, place, change) + of_diffraction};
}

// Diffraction. Formula: airy.h. A measured blur floor already contains diffraction; it is then not
// added again, and its impact is 0. Bound: for the Gaussian, BlurChange; for the pattern of a disc,
// which has no variance, the mean of min(R, |d| slope) + J min(1, sqrt(2) |d_n|/2) over its
// displacements d. Without the box the second term is J/2. Enters: the landing points of the rays.
EffectImpact DiffractionImpact(const EffectOptics& optics, const EffectSite& place,
                               const EffectSet& others) {
  const double radius_px = AiryRadiusPx(optics.camera(), optics.conditions().wavelength_mm);
  if (optics.floor_px() > 0 && others.Has(Effect::kLensFloor)) return {radius_px, 0};
  const double range = place.bright - place.dark;
  if (!optics.is_disc()) {
    const double sigma_px = radius_px / kGaussianAiryRadius;
    const double change = BlurChange(place, sigma_px * sigma_px, optics.SmoothingBy(others, place));
    return {radius_px, EncodedChange(optics, place, change)};
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
  return {radius_px, EncodedChange(optics, place, std::min(range, change))};
}

// Shot noise [D54]. Formula: a Poisson distribution of L n electrons, n at full scale, whose
// standard deviation is sqrt(L/n) in linear light. Bound: that deviation in encoded values. It
// increases with L where the transfer curve is straight, near black, and decreases where the curve
// is a power of at most 1/2; therefore the point where these parts meet is evaluated as well.
// Enters: after the image is formed.
EffectImpact ShotNoiseImpact(const EffectOptics& optics, const EffectSite& place,
                             const EffectSet& /*others*/) {
  const double full_well = optics.conditions().full_well_electrons;
  if (!(full_well > 0)) return {};
  constexpr double kKnee = 0.0031308;  // end of the straight part of sRGB
  double largest = 0;
  EffectSite level = place;
  for (const double light : {place.dark, place.bright,
                             std::clamp(kKnee, place.dark, std::max(place.dark, place.bright))}) {
    // Light of less than one electron is treated as one electron.
    level.dark = std::max(light, 1 / full_well);
    largest = std::max(largest, EncodedSigma(optics, level, std::sqrt(level.dark / full_well)));
  }
  return {largest, largest};
}

// Read noise. Formula: normal noise in electrons before the transfer curve, or in encoded values
// after it. Bound: the former in encoded values where the place is darkest, added to the latter in
// quadrature. Enters: after the image is formed.
EffectImpact ReadNoiseImpact(const EffectOptics& optics, const EffectSite& place,
                             const EffectSet& /*others*/) {
  const EffectConditions& conditions = optics.conditions();
  double sigma = conditions.encoded_noise_grey_levels;
  if (conditions.full_well_electrons > 0) {
    sigma = std::hypot(
        sigma, EncodedSigma(optics, place,
                            conditions.read_noise_electrons / conditions.full_well_electrons));
  }
  return {sigma, sigma};
}

// Quantisation [D54]. Formula: rounding to steps of 1/(2^bits - 1), an error with the standard
// deviation of 1/sqrt(12) step. Enters: at the very end.
EffectImpact QuantisationImpact(const EffectOptics& optics, const EffectSite& /*place*/,
                                const EffectSet& /*others*/) {
  const double sigma = RoundingStep(optics) * std::sqrt(kBoxVariance);
  return {sigma, sigma};
}

// Transfer curve. Formula: IEC 61966-2-1 or a power. Bound: the distance of the curve from linear
// light. The distance is concave, so that its largest value between dark and bright is at its
// maximum or at the nearer end. Enters: after the image is formed.
EffectImpact TransferCurveImpact(const EffectOptics& optics, const EffectSite& place,
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
