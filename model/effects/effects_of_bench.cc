// Effects of a bench that moves a target from frame to frame.
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "model/effects/effect_bounds.h"
#include "thicklens/base/pi.h"

namespace thicklens::model {
namespace {

Eigen::Vector2d FromAxisPx(const EffectOptics& optics, const EffectSite& place) {
  return place.position_px - optics.camera().sensor.principal_point_px;
}

// Bound of the change in linear light by the blur at a place when its depth changes by `shift_mm`
// in either direction.
double ChangeByDepth(const EffectOptics& optics, const EffectSite& place, double shift_mm,
                     const EffectSet& others) {
  if (!others.Has(Effect::kDefocus) || !std::isfinite(place.depth_mm)) return 0;
  double largest = 0;
  const double here_px = optics.DefocusPx(place.depth_mm);
  for (const double sign : {-1.0, 1.0}) {
    const double depth_mm = std::max(place.depth_mm + sign * shift_mm, place.depth_mm / 2);
    const double there_px = optics.DefocusPx(depth_mm);
    EffectSite both = place;
    both.other_depth_mm = depth_mm;
    const double added_px2 = std::abs(there_px * there_px - here_px * here_px);
    largest = std::max(largest, BlurChange(both, added_px2, optics.SmoothingBy(others, both)));
  }
  return largest;
}

}  // namespace

// Lamp fall-off [D55]. Formula: the irradiance by a lamp at the camera of a target at z is (zf/z)^2
// times the irradiance in the plane of focus. Bound: the scaling of the brightest light. Enters: a
// factor of each frame.
EffectImpact LampFalloffImpact(const EffectOptics& optics, const EffectSite& place,
                               const EffectSet& /*others*/) {
  const auto& bench = optics.conditions().bench;
  if (!bench || !bench->lamp_at_camera || !(optics.inverse_focus() > 0)) return {};
  const double light = std::pow(1 / (place.depth_mm * optics.inverse_focus()), 2);
  // The loss is relative to the brighter of the two, as in EncodedScaling.
  return {std::abs(light - 1),
          EncodedScaling(optics, place, light < 1 ? 1 - light : 1 - 1 / light)};
}

// Flicker. Formula: a normal factor of each frame with a relative standard deviation. Enters: a
// factor of each frame.
EffectImpact FlickerImpact(const EffectOptics& optics, const EffectSite& place,
                           const EffectSet& /*others*/) {
  const auto& bench = optics.conditions().bench;
  if (!bench) return {};
  return {bench->flicker, EncodedScaling(optics, place, bench->flicker)};
}

// Magnification. Formula: |m| = f1 D/(f2 z), which is zf/z relative to the plane of focus. Bound:
// ShiftChange of the displacement of the place. Enters: the scale of each frame.
EffectImpact MagnificationImpact(const EffectOptics& optics, const EffectSite& place,
                                 const EffectSet& others) {
  if (!optics.conditions().bench || !(optics.inverse_focus() > 0)) return {};
  const double scale = 1 / (place.depth_mm * optics.inverse_focus());
  const double shift_px = FromAxisPx(optics, place).norm() * std::abs(scale - 1);
  return {shift_px, EncodedChange(optics, place,
                                  ShiftChange(place, shift_px, optics.SmoothingBy(others, place)))};
}

// Drift. Formula: a normal displacement of the target in each frame, with its standard deviation
// per axis in px at zf. Bound: ShiftChange of that standard deviation, for either axis. Enters: the
// position of the target in each frame.
EffectImpact DriftImpact(const EffectOptics& optics, const EffectSite& place,
                         const EffectSet& others) {
  const auto& bench = optics.conditions().bench;
  if (!bench) return {};
  const double shift_px = bench->drift_sigma_px;
  return {shift_px, EncodedChange(optics, place,
                                  ShiftChange(place, shift_px, optics.SmoothingBy(others, place)))};
}

// Tilt. Formula: the depth at which a chief ray meets the target is z0/N, N = 1 + (x p/K)
// tan(tilt). The point that it meets is at x/(N cos(tilt)) and y/N in the image of a target across
// the axis. Bound: the sum of the change of the blur by the depth, for either sign of the tilt, of
// the displacement, and of the light of a lamp at the camera, which is in proportion to N^2.
// Enters: the depth of each column of a frame.
EffectImpact TiltImpact(const EffectOptics& optics, const EffectSite& place,
                        const EffectSet& others) {
  const auto& bench = optics.conditions().bench;
  if (!bench || bench->tilt_deg == 0 || !std::isfinite(place.depth_mm)) return {};
  const double tilt_rad = std::abs(bench->tilt_deg) * kPi / 180;
  const Eigen::Vector2d from_axis_px = FromAxisPx(optics, place).cwiseAbs();
  // No target is visible at more than five times the depth of its middle.
  const double beside = std::min(0.8, from_axis_px.x() / optics.scale_px() * std::tan(tilt_rad));
  // The depth of `place` may be any between that of the middle and that of the column.
  const double shift_mm = place.depth_mm * beside / (1 - beside);
  double displaced_px = 0;
  for (const double nearness : {1 - beside, 1 + beside}) {
    displaced_px = std::max(displaced_px,
                            std::hypot(from_axis_px.x() * (1 / (nearness * std::cos(tilt_rad)) - 1),
                                       from_axis_px.y() * (1 / nearness - 1)));
  }
  const double change = ChangeByDepth(optics, place, shift_mm, others) +
                        ShiftChange(place, displaced_px, optics.SmoothingBy(others, place));
  double grey_levels = EncodedChange(optics, place, std::min(change, place.bright - place.dark));
  if (bench->lamp_at_camera && others.Has(Effect::kLampFalloff)) {
    grey_levels += EncodedScaling(optics, place, 1 - std::pow(1 - beside, 2));
  }
  return {place.depth_mm * beside, grey_levels};
}

// Reading error. Formula: a normal error of the recorded reading, not of the position of the
// target, so that no image changes. Its grey levels are those of a frame at the depth that was
// read. Enters: the readings.
EffectImpact ReadingErrorImpact(const EffectOptics& optics, const EffectSite& place,
                                const EffectSet& others) {
  const auto& bench = optics.conditions().bench;
  if (!bench) return {};
  const double sigma_mm = bench->reading_sigma_mm;
  return {sigma_mm, EncodedChange(optics, place, ChangeByDepth(optics, place, sigma_mm, others))};
}

double ShadingAt(const Sensor& sensor, double corner_stops, const Eigen::Vector2d& position_px) {
  const double part = (position_px - sensor.principal_point_px).squaredNorm() /
                      std::pow(std::max(1.0, FarthestCornerPx(sensor)), 2);
  return std::pow(1 + (std::exp2(-corner_stops / 2) - 1) * part, -2);
}

// Shading. Formula: ShadingAt [D135]. Bound: the scaling of the brightest light. Enters: a factor
// of each pixel. A calibration that does not know of it gets a biased image scale, because a slope
// of the light moves the detail that a registration sees.
EffectImpact ShadingImpact(const EffectOptics& optics, const EffectSite& place,
                           const EffectSet& /*others*/) {
  const auto& bench = optics.conditions().bench;
  if (!bench || bench->corner_stops == 0) return {};
  const double light = ShadingAt(optics.camera().sensor, bench->corner_stops, place.position_px);
  return {std::abs(light - 1),
          EncodedScaling(optics, place, light < 1 ? 1 - light : 1 - 1 / light)};
}

// Dust. Formula: a disc takes a part of the light. Bound: the scaling of the brightest light by
// that part; a speck may be anywhere. Enters: a factor of each pixel. A calibration that does not
// know of it sees detail that neither moves nor blurs: scale and kappa are biased.
EffectImpact DustImpact(const EffectOptics& optics, const EffectSite& place,
                        const EffectSet& /*others*/) {
  const auto& bench = optics.conditions().bench;
  if (!bench) return {};
  return {bench->speck_depth, EncodedScaling(optics, place, bench->speck_depth)};
}

// Aberrations. Formula: FocusDisplacement [D150]. Bound: the change of the blur by the largest
// displacement of the plane of focus at that place: a depth z is blurred as one at
// 1/z' = 1/z - Delta would be. Enters: the blur of each pixel, which depends on the direction.
EffectImpact AberrationsImpact(const EffectOptics& optics, const EffectSite& place,
                               const EffectSet& others) {
  const auto& bench = optics.conditions().bench;
  if (!bench || !std::isfinite(place.depth_mm) || !(optics.inverse_focus() > 0)) return {};
  const double focus_mm = 1 / optics.inverse_focus();
  double by_colour = 0;
  for (int c = 0; c < 3; ++c) {
    by_colour = std::max(by_colour, std::abs(ColourDisplacement(bench->aberrations, focus_mm, c)));
  }
  if (!bench->aberrations.DisplaceFocus() && by_colour == 0) return {};
  const Sensor& sensor = optics.camera().sensor;
  const Eigen::Matrix2d displacement =
      FocusDisplacement(bench->aberrations, focus_mm, place.position_px - sensor.principal_point_px,
                        FarthestCornerPx(sensor));
  const double largest = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(displacement)
                             .eigenvalues()
                             .cwiseAbs()
                             .maxCoeff() +
                         by_colour;
  const double nearness = std::max(1e-3, 1 - largest * place.depth_mm);
  const double shift_mm = place.depth_mm * (1 / nearness - 1);
  return {std::abs(focus_mm - 1 / (1 / focus_mm + largest)),
          EncodedChange(optics, place, ChangeByDepth(optics, place, shift_mm, others))};
}

// Distortion. Formula: a point at the distance r from the axis is displaced by d r rho^2
// (LensAberrations). Bound: ShiftChange of that displacement. Enters: the position of each pixel. A
// calibration that does not know of it gets image scales that depend on the place.
EffectImpact DistortionImpact(const EffectOptics& optics, const EffectSite& place,
                              const EffectSet& others) {
  const auto& bench = optics.conditions().bench;
  if (!bench || bench->aberrations.distortion == 0) return {};
  const Sensor& sensor = optics.camera().sensor;
  const Eigen::Vector2d from_axis_px = place.position_px - sensor.principal_point_px;
  const double shift_px =
      (WithoutDistortion(bench->aberrations.distortion, from_axis_px, FarthestCornerPx(sensor)) -
       from_axis_px)
          .norm();
  return {shift_px, EncodedChange(optics, place,
                                  ShiftChange(place, shift_px, optics.SmoothingBy(others, place)))};
}

double BandFactor(double amplitude, double phase, bool is_square) {
  const double wave = std::sin(2 * kPi * phase);
  return 1 + amplitude * (is_square ? (wave < 0 ? -1.0 : 1.0) : wave);
}

// Bands. Formula: BandFactor of the row (or column), with another phase in each frame. Bound: the
// scaling of the brightest light from a bright to a dark band. Enters: a factor of each row of each
// frame. A calibration that does not know of it cannot register the frames, and takes the bands for
// detail that does not blur.
EffectImpact BandsImpact(const EffectOptics& optics, const EffectSite& place,
                         const EffectSet& /*others*/) {
  const auto& bench = optics.conditions().bench;
  if (!bench) return {};
  return {bench->band_amplitude,
          EncodedScaling(optics, place, std::min(1.0, bench->band_amplitude))};
}

// Exposure drift. Formula: 2^(stops (i/(n - 1) - 1/2)) in frame i of n. Bound: the scaling of the
// brightest light in the first or last frame. Enters: a factor of each frame. A calibration
// compares each frame with its own mean: the drift costs it nothing until values are clipped.
EffectImpact ExposureDriftImpact(const EffectOptics& optics, const EffectSite& place,
                                 const EffectSet& /*others*/) {
  const auto& bench = optics.conditions().bench;
  if (!bench) return {};
  const double change = 1 - std::exp2(-0.5 * std::abs(bench->exposure_drift_stops));
  return {change, EncodedScaling(optics, place, change)};
}

}  // namespace thicklens::model
