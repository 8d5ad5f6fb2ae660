// Effects of the lens and of light on its way through it.
#include <algorithm>
#include <cmath>

#include "effect_bounds.h"
#include "ray_irradiance.h"

namespace thicklens::model {
namespace {

// Of a uniform radiance, at a position of the picture: the mean over the aperture, and the standard
// deviation over it relative to that. Two points per axis at +-1 standard deviation: exact up to
// the third order in the aperture.
struct Irradiance {
  double mean = 0, spread = 0;
};
Irradiance IrradianceAt(const EffectOptics& optics, const Eigen::Vector2d& position_px,
                        double image_distance_mm, bool pinhole) {
  const Sensor& sensor = optics.camera().sensor;
  const Eigen::Vector2d from_axis_px = position_px - sensor.principal_point_px;
  const double reach_mm = pinhole ? 0 : optics.aperture_sigma_mm();
  Irradiance irradiance;
  double squares = 0;
  for (const double x : {-reach_mm, reach_mm}) {
    for (const double y : {-reach_mm, reach_mm}) {
      const Eigen::Vector2d aperture_mm(x, y);
      const double value = RayIrradiance(
          from_axis_px / optics.scale_px() - aperture_mm * optics.inverse_focus(),
          sensor.pixel_pitch_mm * from_axis_px, aperture_mm, image_distance_mm);
      irradiance.mean += value / 4;
      squares += value * value / 4;
    }
  }
  irradiance.spread =
      std::sqrt(std::max(0.0, squares - irradiance.mean * irradiance.mean)) / irradiance.mean;
  return irradiance;
}

// Relative to the principal point, where exposure makes it 1.
Irradiance RelativeIrradianceAt(const EffectOptics& optics, const EffectPlace& place,
                                double image_distance_mm, bool pinhole) {
  Irradiance irradiance = IrradianceAt(optics, place.position_px, image_distance_mm, pinhole);
  irradiance.mean /=
      IrradianceAt(optics, optics.camera().sensor.principal_point_px, image_distance_mm, pinhole)
          .mean;
  return irradiance;
}

double SigmaPx(const EffectOptics& optics, const EffectPlace& place) {
  return std::max(
      std::abs(optics.DefocusPx(place.depth_mm)),
      std::abs(optics.DefocusPx(place.other_depth_mm.value_or(place.depth_mm))));
}

}  // namespace

// Thickness. Formula: (13), (25), (26) depend on the lens through f1 and zf alone, since
// f1 D/f2 = K = f1 zf/(zf - f1): the thin lens f1 that is focused on the same plane puts every ray
// in the same place. Its image distance is another, K instead of d1, and with it cos(beta).
// Bound: the ratio of both irradiances. Enters: the camera is replaced by its thin counterpart.
EffectImpact ThicknessImpact(const EffectOptics& optics, const EffectPlace& place,
                             const EffectSet& others) {
  if (!others.Has(Effect::kFalloff)) return {};
  const bool pinhole = !others.Has(Effect::kDefocus);
  const double thin_mm = optics.scale_px() * optics.camera().sensor.pixel_pitch_mm;
  const Irradiance thick =
      RelativeIrradianceAt(optics, place, optics.camera().image_distance_mm(), pinhole);
  const Irradiance thin = RelativeIrradianceAt(optics, place, thin_mm, pinhole);
  return {0, StoredScaling(optics, place, thin.mean / thick.mean - 1)};
}

// Defocus. Formula: sigma = kappa r |c(z)|/p, (25), (26). Bound: BlurChange of its variance.
// Enters: rays go through the whole aperture instead of its middle.
EffectImpact DefocusImpact(const EffectOptics& optics, const EffectPlace& place,
                           const EffectSet& others) {
  const double sigma_px = SigmaPx(optics, place);
  const double change =
      BlurChange(place, sigma_px * sigma_px, optics.SmoothingBy(others, place));
  return {sigma_px, StoredChange(optics, place, change)};
}

// Aperture shape. Formula: a disc of radius 2 sigma against a Gaussian of sigma, the same second
// moments. Derived here. Bound: the light of the one that is not in the other is 0.289 of all
// (the densities cross at r^2 = 2 log(2) sigma^2, where the disc has taken 0.347 and the Gaussian
// 0.5, and outside the disc the Gaussian has exp(-2)), so at most 0.289 R; small ones, by their
// variance alone, at most twice what their blur changes. Amount: the farthest that their edge
// spreads are apart, 0.040, as a displacement of the edge, 0.040 sigma sqrt(2 pi). Enters: where
// rays go through the aperture.
EffectImpact ApertureShapeImpact(const EffectOptics& optics, const EffectPlace& place,
                                 const EffectSet& others) {
  if (!optics.is_disc() || !others.Has(Effect::kDefocus)) return {};
  constexpr double kNotShared = 0.2887;
  constexpr double kEdge = 0.0404 * 2.5066;
  const double sigma_px = SigmaPx(optics, place);
  const double change = std::min(
      kNotShared * (place.bright - place.dark),
      2 * BlurChange(place, sigma_px * sigma_px,
                     optics.SmoothingBy(others.Without({Effect::kDefocus}), place)));
  return {kEdge * sigma_px, StoredChange(optics, place, change)};
}

// Fall-off. Formula: (12), cos(alpha) cos^3(beta), 1 at the principal point by exposure. Bound:
// its mean over the aperture scales what is seen. Its deviations w from that mean, of standard
// deviation s, change it by the covariance of w with what different rays see, whose standard
// deviation is at most sqrt((I - dark)(bright - I)) where they see I in the mean, and at most what
// their displacement by defocus changes. Enters: a weight of each ray.
EffectImpact FalloffImpact(const EffectOptics& optics, const EffectPlace& place,
                           const EffectSet& others) {
  const bool pinhole = !others.Has(Effect::kDefocus);
  const Irradiance irradiance =
      RelativeIrradianceAt(optics, place, optics.camera().image_distance_mm(), pinhole);
  const double loss = 1 - irradiance.mean;
  double mixed = 0;
  if (!pinhole) {
    EffectOptics::Smoothing boxed;
    boxed.boxed = others.Has(Effect::kPixelBox);
    const double displaced = ShiftChange(place, SigmaPx(optics, place), boxed);
    constexpr int kLevels = 16;
    EffectPlace level = place;
    for (int i = 0; i < kLevels; ++i) {
      level.dark = place.dark + (place.bright - place.dark) * i / kLevels;
      const double most = std::sqrt((level.dark - place.dark) * (place.bright - level.dark));
      mixed = std::max(mixed, StoredChange(optics, level,
                                           irradiance.spread * std::min(most, displaced)));
    }
  }
  return {std::abs(loss), StoredScaling(optics, place, loss) + mixed};
}

// Vignetting. Formula: (10), rays of directional samples at u cross the aperture at
// a = ((zl + d0) u - zl s)/d0: for zl != 0 the bundle of a pixel at s wanders over the aperture by
// zl s/d0, in standard deviations of its transmission w. Bound: the light of a Gaussian and the
// same one displaced by w that they do not share is erf(w/(2 sqrt(2))), which weighs what
// different rays see; the bundle's own weights are normalised. Enters: weights of the views that
// depend on the pixel.
EffectImpact VignettingImpact(const EffectOptics& optics, const EffectPlace& place,
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
  return {lost, StoredChange(optics, place, lost * (place.bright - place.dark))};
}

// Occlusion. Formula: the parallax between both sides of an edge of depth, kappa r |c(z1) - c(z2)|/p
// for each standard deviation of the aperture. Bound: rays that are carried past the edge see
// another surface: as at a jump of the height of the range, BlurChange of that parallax. Enters:
// each ray is traced to what it meets first.
EffectImpact OcclusionImpact(const EffectOptics& optics, const EffectPlace& place,
                             const EffectSet& others) {
  if (!place.other_depth_mm || !others.Has(Effect::kDefocus)) return {};
  const double parallax_px =
      std::abs(optics.DefocusPx(place.depth_mm) - optics.DefocusPx(*place.other_depth_mm));
  EffectPlace edge = place;
  edge.jump = place.bright - place.dark;
  edge.slope = edge.bend = 0;
  EffectOptics::Smoothing boxed;
  boxed.boxed = others.Has(Effect::kPixelBox);
  return {parallax_px,
          StoredChange(optics, place, BlurChange(edge, parallax_px * parallax_px, boxed))};
}

}  // namespace thicklens::model
