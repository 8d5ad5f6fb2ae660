#include "thicklens/model/effect_impact.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "model/effects/effect_bounds.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/validity.h"

namespace thicklens::model {
namespace {

using Section = EffectImpact (*)(const EffectOptics&, const EffectSite&, const EffectSet&);

Section SectionOf(Effect effect) {
  switch (effect) {
    case Effect::kThickness:
      return ThicknessImpact;
    case Effect::kDefocus:
      return DefocusImpact;
    case Effect::kApertureShape:
      return ApertureShapeImpact;
    case Effect::kFalloff:
      return FalloffImpact;
    case Effect::kVignetting:
      return VignettingImpact;
    case Effect::kOcclusion:
      return OcclusionImpact;
    case Effect::kPixelBox:
      return PixelBoxImpact;
    case Effect::kLensFloor:
      return LensFloorImpact;
    case Effect::kDiffraction:
      return DiffractionImpact;
    case Effect::kShotNoise:
      return ShotNoiseImpact;
    case Effect::kReadNoise:
      return ReadNoiseImpact;
    case Effect::kQuantisation:
      return QuantisationImpact;
    case Effect::kTransferCurve:
      return TransferCurveImpact;
    case Effect::kLampFalloff:
      return LampFalloffImpact;
    case Effect::kFlicker:
      return FlickerImpact;
    case Effect::kMagnification:
      return MagnificationImpact;
    case Effect::kDrift:
      return DriftImpact;
    case Effect::kTilt:
      return TiltImpact;
    case Effect::kReadingError:
      return ReadingErrorImpact;
    case Effect::kShading:
      return ShadingImpact;
    case Effect::kDust:
      return DustImpact;
    case Effect::kAberrations:
      return AberrationsImpact;
    case Effect::kDistortion:
      return DistortionImpact;
    case Effect::kBands:
      return BandsImpact;
    case Effect::kExposureDrift:
      return ExposureDriftImpact;
  }
  throw Error("no such effect");
}

}  // namespace

bool MattersMore(const EffectImpact& a, const EffectImpact& b) {
  return std::pair(a.grey_levels, a.amount) > std::pair(b.grey_levels, b.amount);
}

void CheckEffects(const EffectConditions& conditions, const std::vector<EffectSite>& places) {
  std::string why;
  if (!conditions.IsValid(&why)) throw Error("effects: " + why);
  if (places.empty())
    throw Error("effects: the list of places is empty: at least one place is needed");
}

LargestEffectImpact FindImpact(Effect effect, const EffectConditions& conditions,
                               const std::vector<EffectSite>& places, const EffectSet& others) {
  const Section section = SectionOf(effect);
  const EffectOptics optics(conditions, others.With({effect}));
  LargestEffectImpact finding{effect, section(optics, places.front(), others), places.front()};
  for (const EffectSite& place : places) {
    const EffectImpact impact = section(optics, place, others);
    if (MattersMore(impact, finding.impact)) finding = {effect, impact, place};
  }
  // A bound that is a sum of several parts may exceed the largest possible change of a stored
  // value.
  if (!FactsOf(effect).random) {
    finding.impact.grey_levels = std::min(finding.impact.grey_levels, 255.0);
  }
  return finding;
}

bool EffectConditions::IsValid(std::string* why) const {
  std::string inner;
  if (!camera.IsValid(&inner)) return Fail(why, "camera: " + inner);
  for (const bool known : {camera.calibration && camera.calibration->image_distance_mm,
                           camera.calibration && camera.calibration->blur_ratio}) {
    if (!known) {
      return Fail(why,
                  fmt::format("camera '{}': image_distance_mm and blur_ratio must be calibrated",
                              camera.name));
    }
  }
  if (!(wavelength_mm > 0) || !std::isfinite(wavelength_mm)) {
    return Fail(why, fmt::format("wavelength_mm is {}: it must be finite and > 0", wavelength_mm));
  }
  if (planes && (!std::isfinite(planes->uv_depth_mm) || planes->plane_spacing_mm == 0 ||
                 !std::isfinite(planes->plane_spacing_mm))) {
    return Fail(why, fmt::format("planes: UV at {} mm, ST {} mm beyond it: both numbers must be "
                                 "finite, and the planes must differ",
                                 planes->uv_depth_mm, planes->plane_spacing_mm));
  }
  if (!(bits >= 1 && bits <= 32)) {
    return Fail(why, fmt::format("bits is {}: it must be from 1 to 32", bits));
  }
  std::vector<std::pair<const char*, double>> amounts = {
      {"encoded_noise_grey_levels", encoded_noise_grey_levels},
      {"full_well_electrons", full_well_electrons},
      {"read_noise_electrons", read_noise_electrons}};
  if (bench) {
    amounts.insert(amounts.end(), {{"bench.flicker", bench->flicker},
                                   {"bench.drift_sigma_px", bench->drift_sigma_px},
                                   {"bench.reading_sigma_mm", bench->reading_sigma_mm},
                                   {"bench.speck_depth", bench->speck_depth},
                                   {"bench.band_amplitude", bench->band_amplitude}});
    if (!std::isfinite(bench->corner_stops)) {
      return Fail(why,
                  fmt::format("bench.corner_stops is {}: it must be finite", bench->corner_stops));
    }
    if (camera.calibration && camera.calibration->image_distance_mm &&
        !bench->aberrations.IsValid(camera.lens, camera.focus_depth_mm(), why))
      return false;
    if (!std::isfinite(bench->exposure_drift_stops)) {
      return Fail(why, fmt::format("bench.exposure_drift_stops is {}: it must be finite",
                                   bench->exposure_drift_stops));
    }
    if (!(std::abs(bench->tilt_deg) < 90)) {
      return Fail(
          why, fmt::format("bench.tilt_deg is {}: it must be between -90 and 90", bench->tilt_deg));
    }
  }
  for (const auto& [field, value] : amounts) {
    if (!(value >= 0) || !std::isfinite(value)) {
      return Fail(why, fmt::format("{} is {}: it must be finite and >= 0", field, value));
    }
  }
  return true;
}

EffectImpact ImpactAt(Effect effect, const EffectConditions& conditions, const EffectSite& place,
                      const EffectSet& others) {
  CheckEffects(conditions, {place});
  return SectionOf(effect)(EffectOptics(conditions, others.With({effect})), place,
                           others.Without({effect}));
}

std::vector<LargestEffectImpact> FindImpacts(const EffectConditions& conditions,
                                             const std::vector<EffectSite>& places,
                                             const EffectSet& effects, int threads) {
  CheckEffects(conditions, places);
  const std::vector<Effect> each = effects.Effects();
  std::vector<LargestEffectImpact> findings(each.size());
  ParallelFor(static_cast<int>(each.size()), threads, [&](int i) {
    const Effect effect = each[static_cast<std::size_t>(i)];
    findings[static_cast<std::size_t>(i)] =
        FindImpact(effect, conditions, places, effects.Without({effect}));
  });
  return findings;
}

std::vector<EffectSite> PlacesBetween(const Camera& camera, double near_mm, double far_mm,
                                      bool occlusion) {
  if (!(near_mm > 0) || !(far_mm >= near_mm) || !std::isfinite(near_mm)) {
    throw Error(
        fmt::format("depths from {} to {} mm: both must be > 0, and the first must be finite and "
                    "at most the second",
                    near_mm, far_mm));
  }
  constexpr int kSteps = 33;
  const Sensor& sensor = camera.sensor;
  const Eigen::Vector2d last_px(sensor.width_px - 1, sensor.height_px - 1);
  const Eigen::Vector2d middle_px =
      sensor.principal_point_px.cwiseMax(0).cwiseMin(last_px).array().round();
  const Eigen::Vector2d corner_px = (2 * middle_px.array() > last_px.array())
                                        .select(Eigen::Array2d::Zero(), last_px.array())
                                        .matrix();
  std::vector<EffectSite> places;
  for (int i = 0; i < kSteps; ++i) {
    const double share = static_cast<double>(i) / (kSteps - 1);
    const double depth_mm = i == 0 ? near_mm : 1 / ((1 - share) / near_mm + share / far_mm);
    for (const Eigen::Vector2d& position_px : {middle_px, corner_px}) {
      EffectSite place;
      place.position_px = position_px;
      place.depth_mm = depth_mm;
      places.push_back(place);
      if (i == 0 && occlusion && far_mm > near_mm) {
        place.other_depth_mm = far_mm;
        places.push_back(place);
      }
    }
  }
  return places;
}

}  // namespace thicklens::model
