// Effects of the lens and of the light on its way through the lens.
#include <algorithm>
#include <cmath>
#include <vector>

#include "model/effects/aperture_irradiance.h"
#include "model/effects/effect_bounds.h"
#include "thicklens/base/pi.h"

namespace thicklens::model {
namespace {

double SigmaPx(const EffectOptics& optics, const EffectSite& place) {
  return std::max(std::abs(optics.DefocusPx(place.depth_mm)),
                  std::abs(optics.DefocusPx(place.other_depth_mm.value_or(place.depth_mm))));
}

// [D50] Bound of the stored change by weights of the rays over the aperture. `weights` has one
// value per aperture point, with the mean 1 and the standard deviation s. The change is the
// covariance of the weights with the radiance along the rays. The standard deviation of that
// radiance is at most sqrt((I - dark)(bright - I)), where I is its mean, and at most the change by
// the displacement of the rays by defocus.
double WeightChange(const EffectOptics& optics, const EffectSite& place, Aperture aperture,
                    const std::vector<double>& weights, const EffectSet& others) {
  double square = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    square += AperturePoints(aperture)[i].weight * std::pow(weights[i] - 1, 2);
  }
  const double sd = std::sqrt(square);
  if (!(sd > 0)) return 0;
  EffectOptics::Smoothing boxed;
  boxed.boxed = others.Has(Effect::kPixelBox);
  const double displaced = ShiftChange(place, SigmaPx(optics, place), boxed);
  constexpr int kLevels = 16;
  double most = 0;
  EffectSite level = place;
  for (int i = 0; i < kLevels; ++i) {
    level.dark = place.dark + (place.bright - place.dark) * i / kLevels;
    const double seen = std::sqrt((level.dark - place.dark) * (place.bright - level.dark));
    most = std::max(most, EncodedChange(optics, level, sd * std::min(seen, displaced)));
  }
  return most;
}

// Bound of the stored change when the fall-off of the whole aperture replaces that of its middle.
double FalloffOfAperture(const EffectOptics& optics, const EffectSite& place,
                         const EffectSet& others, Aperture aperture) {
  if (!others.Has(Effect::kFalloff)) return 0;
  const double distance_mm = optics.image_distance_mm();
  const Irradiance whole = IrradianceAt(optics, place.position_px, distance_mm, aperture);
  const Irradiance middle =
      IrradianceAt(optics, place.position_px, distance_mm, Aperture::kPinhole);
  return EncodedScaling(optics, place, whole.mean / middle.mean - 1) +
         WeightChange(optics, place, aperture, whole.over_mean, others);
}

// Bound of the stored change when the fall-off of a disc replaces that of a Gaussian. Weights that
// are linear over the aperture, g A, change the weighted radiance of the rays by at most
// g R/2 integral |A_x| |D|, where D is the difference of both densities. That is 0.587 of
// g sigma R/2, the value of the Gaussian.
double FalloffOfShape(const EffectOptics& optics, const EffectSite& place,
                      const EffectSet& others) {
  if (!others.Has(Effect::kFalloff)) return 0;
  constexpr double kNotShared = 0.587;
  const double distance_mm = optics.image_distance_mm();
  const Irradiance disc = IrradianceAt(optics, place.position_px, distance_mm, Aperture::kDisc);
  const Irradiance gaussian =
      IrradianceAt(optics, place.position_px, distance_mm, Aperture::kGaussian);
  return EncodedScaling(optics, place, gaussian.mean / disc.mean - 1) +
         kNotShared * WeightChange(optics, place, Aperture::kGaussian, gaussian.over_mean, others);
}

}  // namespace

// Thickness [D7]. Formula: [S13], [S25], [S26] depend on the lens through f1 and zf alone, since
// f1 D/f2 = K = f1 zf/(zf - f1). The thin lens f1 that is focused on the same plane therefore gives
// every ray the same landing point. Its image distance is K instead of d1, so that cos(beta)
// differs. Bound: the ratio of both irradiances, and of their weights of the rays. Enters: the
// camera is replaced by its thin counterpart. Amount: the ratio's distance from 1; no ray is
// displaced.
EffectImpact ThicknessImpact(const EffectOptics& optics, const EffectSite& place,
                             const EffectSet& others) {
  if (!others.Has(Effect::kFalloff)) return {};
  const Aperture aperture = ApertureOf(optics, others);
  const double thin_mm = optics.scale_px() * optics.camera().sensor.pixel_pitch_mm;
  Irradiance thick =
      IrradianceAt(optics, place.position_px, optics.camera().image_distance_mm(), aperture);
  const Irradiance thin = IrradianceAt(optics, place.position_px, thin_mm, aperture);
  for (std::size_t i = 0; i < thin.over_mean.size(); ++i) {
    thick.over_mean[i] += 1 - thin.over_mean[i];
  }
  const double change = thin.mean / thick.mean - 1;
  return {std::abs(change), EncodedScaling(optics, place, change) +
                                WeightChange(optics, place, aperture, thick.over_mean, others)};
}

// Defocus. Formula: sigma = kappa r |c(z)|/p [D4], [S25], [S26]. Bound: the sum of BlurChange of
// its variance and FalloffOfAperture. Enters: rays pass through the whole aperture instead of its
// middle.
EffectImpact DefocusImpact(const EffectOptics& optics, const EffectSite& place,
                           const EffectSet& others) {
  const double sigma_px = SigmaPx(optics, place);
  const double change = BlurChange(place, sigma_px * sigma_px, optics.SmoothingBy(others, place));
  EffectSet all = others;
  all.Add(Effect::kDefocus);
  const double of_falloff = FalloffOfAperture(optics, place, others, ApertureOf(optics, all));
  return {sigma_px, EncodedChange(optics, place, change) + of_falloff, of_falloff};
}

// Aperture shape. Formula: a disc of radius 2 sigma replaces a Gaussian of sigma with the same
// second moments. Bound, derived here [D51]: D is the difference of both densities and A(r) the
// difference of their light within r, min(r^2/(4 sigma^2), 1) - 1 + exp(-r^2/(2 sigma^2)). With
// psi' = A/(2 pi r), so that D is the Laplacian of psi, the change D * L is at most
//   1/2 integral |D| R = 0.289 R                      for any image of range R
//   integral |psi'| sup|grad L| = 0.222 sigma slope
//   integral |psi| sup|laplacian L| = 0.0940 sigma^2 bend
// At a straight jump it is at most the largest distance of the two edge spread functions, 0.0404 of
// the jump; at a corner of two jumps it is at most twice that. FalloffOfShape is added. Amount:
// 0.0404 as a displacement of the edge, times sigma sqrt(2 pi). Enters: the positions of the rays
// in the aperture.
EffectImpact ApertureShapeImpact(const EffectOptics& optics, const EffectSite& place,
                                 const EffectSet& others) {
  if (!optics.is_disc() || !others.Has(Effect::kDefocus)) return {};
  constexpr double kNotShared = 0.2887, kOfSlope = 0.2216, kOfNonlinearity = 0.0940, kEdge = 0.0404;
  const double sigma_px = SigmaPx(optics, place);
  const double smooth = std::min(kOfSlope * sigma_px * place.slope,
                                 kOfNonlinearity * sigma_px * sigma_px * place.bend);
  const double blurred =
      2 * BlurChange(place, sigma_px * sigma_px,
                     optics.SmoothingBy(others.Without({Effect::kDefocus}), place));
  const double change = std::min(
      {kNotShared * (place.bright - place.dark), smooth + 2 * kEdge * place.jump, blurred});
  const double of_falloff = FalloffOfShape(optics, place, others);
  return {kEdge * std::sqrt(2 * kPi) * sigma_px, EncodedChange(optics, place, change) + of_falloff,
          of_falloff};
}

// Fall-off. Formula: [S12], cos(alpha) cos^3(beta), which the exposure scales to 1 at the principal
// point. Bound: its mean over the aperture scales the radiance; its deviations from that mean are
// weights of the radiance along the rays. Enters: a weight of each ray.
EffectImpact FalloffImpact(const EffectOptics& optics, const EffectSite& place,
                           const EffectSet& others) {
  const Aperture aperture = ApertureOf(optics, others);
  const Irradiance irradiance =
      IrradianceAt(optics, place.position_px, optics.image_distance_mm(), aperture);
  const double loss = 1 - irradiance.mean;
  return {std::abs(loss), EncodedScaling(optics, place, loss) +
                              WeightChange(optics, place, aperture, irradiance.over_mean, others)};
}

// Vignetting. Formula: by [S10], rays of directional samples at u cross the aperture at
// a = ((zl + d0) u - zl s)/d0. For zl != 0 the bundle of a pixel at s is displaced on the aperture
// by zl s/d0, which is w in standard deviations of the transmission. Bound: a Gaussian and the same
// Gaussian displaced by w differ in the share erf(w/(2 sqrt(2))) of their light [D52], which is the
// weight of the radiance along the rays; the weights of the bundle are normalised. Enters: weights
// of the views that depend on the pixel.
EffectImpact VignettingImpact(const EffectOptics& optics, const EffectSite& place,
                              const EffectSet& others) {
  const auto& planes = optics.conditions().planes;
  if (!planes || planes->uv_depth_mm == 0 || !others.Has(Effect::kDefocus) ||
      !(optics.aperture_sigma_mm() > 0)) {
    return {};
  }
  const double st_depth_mm = planes->uv_depth_mm + planes->plane_spacing_mm;
  const double s_mm = (place.position_px - optics.camera().sensor.principal_point_px).norm() *
                      st_depth_mm / optics.scale_px();
  const double wander =
      std::abs(planes->uv_depth_mm * s_mm / planes->plane_spacing_mm) / optics.aperture_sigma_mm();
  const double lost = std::erf(wander / (2 * std::sqrt(2.0)));
  return {lost, EncodedChange(optics, place, lost * (place.bright - place.dark))};
}

// Occlusion [D53]. Formula: the parallax between both sides of a depth edge,
// kappa r |c(z1) - c(z2)|/p for each standard deviation of the aperture. Bound: rays that pass the
// edge meet another surface. The bound is therefore that of a jump with the height of the range:
// BlurChange of the parallax. Enters: each ray is traced to the first surface that it meets.
EffectImpact OcclusionImpact(const EffectOptics& optics, const EffectSite& place,
                             const EffectSet& others) {
  if (!place.other_depth_mm || !others.Has(Effect::kDefocus)) return {};
  const double parallax_px =
      std::abs(optics.DefocusPx(place.depth_mm) - optics.DefocusPx(*place.other_depth_mm));
  EffectSite edge = place;
  edge.jump = place.bright - place.dark;
  edge.slope = edge.bend = 0;
  EffectOptics::Smoothing boxed;
  boxed.boxed = others.Has(Effect::kPixelBox);
  return {parallax_px,
          EncodedChange(optics, place, BlurChange(edge, parallax_px * parallax_px, boxed))};
}

}  // namespace thicklens::model
