#include "model/effects/effect_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "thicklens/base/pi.h"

namespace thicklens::model {
namespace {

double Range(const EffectSite& place) { return std::max(0.0, place.bright - place.dark); }

}  // namespace

EffectOptics::EffectOptics(const EffectConditions& given, const EffectSet& of_image)
    : conditions_(given),
      inverse_focus_(1 / given.camera.focus_depth_mm()),
      aperture_sigma_mm_(given.camera.blur_ratio() * given.camera.lens.aperture_radius_mm),
      scale_px_(given.camera.focal_scale_px()) {
  const auto& floor = given.camera.calibration->blur_floor_px;
  if (floor) floor_px_ = floor->value;
  image_distance_mm_ = of_image.Has(Effect::kThickness)
                           ? given.camera.image_distance_mm()
                           : scale_px_ * given.camera.sensor.pixel_pitch_mm;
  transfer_ =
      of_image.Has(Effect::kTransferCurve) ? given.camera.sensor.transfer : TransferCurve::Linear();
}

double EffectOptics::DefocusPx(double depth_mm) const {
  return aperture_sigma_mm_ * scale_px_ * (1 / depth_mm - inverse_focus_);
}

// The sharpest of the surfaces at different depths determines the smoothing. Between two surfaces
// on both sides of the plane of focus there may be one in that plane.
EffectOptics::Smoothing EffectOptics::SmoothingBy(const EffectSet& effects,
                                                  const EffectSite& place) const {
  Smoothing smoothing;
  smoothing.boxed = effects.Has(Effect::kPixelBox);
  if (effects.Has(Effect::kLensFloor)) smoothing.gaussian_px2 = floor_px_ * floor_px_;
  if (!effects.Has(Effect::kDefocus)) return smoothing;
  const double here_px = DefocusPx(place.depth_mm);
  const double there_px = DefocusPx(place.other_depth_mm.value_or(place.depth_mm));
  double sigma_px = here_px * there_px > 0 ? std::min(std::abs(here_px), std::abs(there_px)) : 0;
  if (place.sharpest_depth_mm) sigma_px = std::abs(DefocusPx(*place.sharpest_depth_mm));
  if (is_disc() && effects.Has(Effect::kApertureShape)) {
    smoothing.disc_px = 2 * sigma_px;
  } else {
    smoothing.gaussian_px2 += sigma_px * sigma_px;
  }
  return smoothing;
}

// Derived here [D48]. k is the density of the added displacement d (mean 0, variance v per axis), L
// is the image with the range R, and I = k * L:
//   |I - L| <= R
//   |I - L| <= 1/2 v sup(|L_xx| + |L_yy|)                 Taylor; the mean of d vanishes
//   |I - L| <= E|d| sup|grad L|, E|d| <= sqrt(2 v)        Jensen
// At a straight jump of height J, which the pixel's box has turned into a ramp with a slope of at
// most sqrt(2) J per px, the bound at the foot of the ramp is sqrt(2) J E[d_n^+], which is
// J sqrt(v/pi) for a Gaussian. Without the box it is half of the jump. In an image that already has
// a Gaussian blur of variance g,
//   sup(|L_xx| + |L_yy|) <= R 4 phi(1)/g, phi the normal density,
// since |d2/dx2 (G * M)| <= R/2 integral |d2G/dx2| = 2 phi(1) R/g. In an image that has been
// averaged over a disc D of radius b,
//   |I - L| <= R/2 integral |k * D - D| <= R/2 E|d_n| (perimeter/area of D) = R/b E|d_n|.
// The range bounds the jumps of the radiance in the last two cases.
double BlurChange(const EffectSite& place, double variance_px2,
                  const EffectOptics::Smoothing& other) {
  if (!(variance_px2 > 0)) return 0;
  const double sigma_px = std::sqrt(variance_px2);
  const double range = Range(place);
  const double smooth =
      std::min(variance_px2 / 2 * place.bend, std::sqrt(2.0) * sigma_px * place.slope);
  const double of_jump = other.boxed ? std::min(sigma_px / std::sqrt(kPi), 1.0) : 0.5;
  double change = std::min(range, smooth + place.jump * of_jump);
  if (other.gaussian_px2 > 0) {
    const double density_at_1 = std::exp(-0.5) / std::sqrt(2 * kPi);
    change = std::min(change, variance_px2 / 2 * range * 4 * density_at_1 / other.gaussian_px2);
  }
  if (other.disc_px > 0) {
    change = std::min(change, range / other.disc_px * sigma_px * std::sqrt(2 / kPi));
  }
  return change;
}

// The change is |L(x + d) - L(x)| <= |d| sup|grad L|. At a jump that a box has turned into a ramp
// it is at most sqrt(2) J |d| [D49]. After a Gaussian blur of variance g it is at most
// R |d|/sqrt(2 pi g), after a disc of radius b at most R |d| 2/(pi b): the maximum is that of an
// edge.
double ShiftChange(const EffectSite& place, double shift_px, const EffectOptics::Smoothing& other) {
  const double range = Range(place);
  double slope = place.slope + std::sqrt(2.0) * place.jump;
  if (!other.boxed && place.jump > 0) slope = std::numeric_limits<double>::infinity();
  if (other.gaussian_px2 > 0)
    slope = std::min(slope, range / std::sqrt(2 * kPi * other.gaussian_px2));
  if (other.disc_px > 0) slope = std::min(slope, 2 * range / (kPi * other.disc_px));
  return shift_px == 0 ? 0 : std::min(range, slope * std::abs(shift_px));
}

// Transfer curves are concave: the same change of light has the largest effect where it is dark.
double EncodedChange(const EffectOptics& optics, const EffectSite& place, double change) {
  const TransferCurve& transfer = optics.transfer();
  const double dark = std::clamp(place.dark, 0.0, 1.0);
  const double lit = std::min(dark + change, std::clamp(place.bright, dark, 1.0));
  return 255 * (transfer.Encode(lit) - transfer.Encode(dark));
}

// Encode(L) - Encode(L (1 - e)) increases with L for curves that are powers of light, or straight.
double EncodedScaling(const EffectOptics& optics, const EffectSite& place, double relative) {
  const TransferCurve& transfer = optics.transfer();
  const double bright = std::clamp(place.bright, 0.0, 1.0);
  const double other = std::clamp(bright * (1 - std::abs(relative)), 0.0, 1.0);
  return 255 * (transfer.Encode(bright) - transfer.Encode(other));
}

double EncodedSigma(const EffectOptics& optics, const EffectSite& place, double sigma) {
  const TransferCurve& transfer = optics.transfer();
  const double dark = std::clamp(place.dark, 0.0, 1.0);
  return 255 * (transfer.Encode(dark + sigma) - transfer.Encode(dark - sigma)) / 2;
}

}  // namespace thicklens::model
