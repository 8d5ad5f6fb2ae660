#include "scene_photograph.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "airy.h"
#include "ray_irradiance.h"
#include "sampling_plan.h"

namespace thicklens::model {

RaySpread SpreadOf(const SceneSimulationOptions& options, const EffectSet& on) {
  const Camera& camera = options.camera;
  RaySpread spread;
  if (on.Has(Effect::kDefocus)) {
    spread.aperture = on.Has(Effect::kApertureShape) ? camera.psf : Psf::kGaussian;
  }
  spread.box = on.Has(Effect::kPixelBox);
  if (on.Has(Effect::kLensFloor) && camera.calibration->blur_floor_px) {
    spread.gaussian_px = camera.calibration->blur_floor_px->value;
  }
  // A floor that was measured holds the diffraction.
  if (on.Has(Effect::kDiffraction) && !(spread.gaussian_px > 0)) {
    const double radius_px = AiryRadiusPx(camera, options.wavelength_mm);
    if (camera.psf == Psf::kDisc) {
      spread.airy_px = radius_px;
    } else {
      spread.gaussian_px = radius_px / kGaussianAiryRadius;
    }
  }
  return spread;
}

ScenePhotograph::ScenePhotograph(const SceneSimulationOptions& options,
                                 const SceneGeometry& geometry,
                                 const std::vector<SceneTexture>& textures,
                                 const SceneSurvey& survey, const EffectSet& on,
                                 const TransferCurve& stored)
    : geometry_(geometry), textures_(textures), survey_(survey), on_(on) {
  // The thin lens of the same focus has K for its image distance.
  irradiance_distance_mm_ = on.Has(Effect::kThickness) ? options.camera.image_distance_mm()
                                                       : options.camera.focal_scale_px() *
                                                             geometry.sensor().pixel_pitch_mm;
  MakeSets(options, stored);
}

void ScenePhotograph::MakeSets(const SceneSimulationOptions& options, const TransferCurve& stored) {
  const RaySpread spread = SpreadOf(options, on_);
  SamplingSpread sampling;
  sampling.landing_px = std::sqrt((spread.box ? 1.0 / 12 : 0) + std::pow(spread.gaussian_px, 2));
  sampling.airy_px = spread.airy_px;
  if (!spread.aperture && sampling.landing_px == 0 && spread.airy_px == 0) {
    sets_.push_back(Prepared({PixelRay()}));
    set_of_block_.assign(survey_.blocks().size(), 0);
    return;
  }
  std::map<int, std::size_t> set_of_count;
  for (const SceneBlock& block : survey_.blocks()) {
    sampling.defocus_px = spread.aperture ? block.sigma_px : 0;
    if (spread.aperture && on_.Has(Effect::kFalloff)) sampling.irradiance = IrradianceSd(block);
    const int rays = RaysWithin(block, sampling, stored, options.sampling_error_grey_levels,
                                options.rays_per_pixel);
    sampling_error_ = std::max(sampling_error_, SamplingError(block, sampling, stored, rays));
    const auto [found, is_new] = set_of_count.emplace(rays, sets_.size());
    if (is_new) sets_.push_back(Prepared(PhotographRays(spread, rays)));
    set_of_block_.push_back(found->second);
  }
}

// Relative, over the aperture: of points at +-1 standard deviation on both axes.
double ScenePhotograph::IrradianceSd(const SceneBlock& block) const {
  const Eigen::Vector2d& position_px = block.places.front().position_px;
  const double reach_mm = geometry_.aperture_sigma_mm();
  double sum = 0, squares = 0;
  for (const double x : {-reach_mm, reach_mm}) {
    for (const double y : {-reach_mm, reach_mm}) {
      const double value = Irradiance(position_px, geometry_.RayAt(position_px, {x, y}));
      sum += value / 4;
      squares += value * value / 4;
    }
  }
  return std::sqrt(std::max(0.0, squares - sum * sum)) / sum;
}

ScenePhotograph::RaySet ScenePhotograph::Prepared(const std::vector<PixelRay>& rays) const {
  const Sensor& sensor = geometry_.sensor();
  const Eigen::Vector2d& axis_px = sensor.principal_point_px;
  const auto count = static_cast<Eigen::Index>(rays.size());
  RaySet set;
  set.slope_x.resize(count);
  set.slope_y.resize(count);
  set.behind_x.resize(count);
  set.behind_y.resize(count);
  double sum = 0;
  for (const PixelRay& ray : rays) {
    const auto i = static_cast<Eigen::Index>(set.rays.size());
    PreparedRay prepared;
    prepared.aperture_mm = geometry_.aperture_sigma_mm() * ray.aperture;
    prepared.slope = geometry_.RayAt(axis_px + ray.offset_px, prepared.aperture_mm).slope;
    const Eigen::Vector2d behind_mm = sensor.pixel_pitch_mm * ray.offset_px + prepared.aperture_mm;
    set.slope_x(i) = static_cast<float>(prepared.slope.x());
    set.slope_y(i) = static_cast<float>(prepared.slope.y());
    set.behind_x(i) = static_cast<float>(behind_mm.x());
    set.behind_y(i) = static_cast<float>(behind_mm.y());
    set.rays.push_back(prepared);
    // (12) fixes its constant k by exposure: uniform radiance 1 gives 1 at the principal point.
    sum += Irradiance(axis_px, geometry_.RayAt(axis_px, prepared.aperture_mm));
  }
  set.exposure = static_cast<double>(rays.size()) / sum;
  return set;
}

double ScenePhotograph::Irradiance(const Eigen::Vector2d& position_px, const SceneRay& ray) const {
  const Sensor& sensor = geometry_.sensor();
  return RayIrradiance(ray.slope, sensor.pixel_pitch_mm * (position_px - sensor.principal_point_px),
                       ray.aperture_mm, irradiance_distance_mm_);
}

// RayIrradiance of all of them at once.
Eigen::ArrayXf ScenePhotograph::Weights(const RaySet& set, const Eigen::Vector2d& centre_px) const {
  const Sensor& sensor = geometry_.sensor();
  const Eigen::Vector2f slope = geometry_.RayAt(centre_px, {0, 0}).slope.cast<float>();
  const Eigen::Vector2f landing_mm =
      (sensor.pixel_pitch_mm * (centre_px - sensor.principal_point_px)).cast<float>();
  const auto per_distance2 =
      static_cast<float>(1 / (irradiance_distance_mm_ * irradiance_distance_mm_));
  const auto alpha = 1 + (set.slope_x + slope.x()).square() + (set.slope_y + slope.y()).square();
  const Eigen::ArrayXf beta = 1 + per_distance2 * ((set.behind_x + landing_mm.x()).square() +
                                                   (set.behind_y + landing_mm.y()).square());
  return static_cast<float>(set.exposure) / ((alpha * beta).sqrt() * beta);
}

Eigen::Array4f ScenePhotograph::LightAlong(const SceneBlock& block, const SceneRay& ray) const {
  const SceneHit hit = geometry_.Trace(ray, block.layers);
  return LayerLight(geometry_, textures_[hit.layer], hit.layer, ray, hit.position_mm);
}

Eigen::Array4f ScenePhotograph::LightOf(std::size_t layer, const SceneRay& ray) const {
  const double depth_mm = HitDepthMm(geometry_.layers()[layer].plane, ray);
  return LayerLight(geometry_, textures_[layer], layer, ray, ray.PositionMm(depth_mm));
}

// Of the surface that the pixel shows, the ray passes a point; what the middle of the aperture sees
// there is what the ray sees.
Eigen::Array4f ScenePhotograph::LightWithoutOcclusion(const SceneBlock& block,
                                                      const PlaneOptions& surface,
                                                      const SceneRay& ray) const {
  const double depth_mm = HitDepthMm(surface, ray);
  const Eigen::Vector2d point_px = geometry_.ChiefPositionPx(ray.PositionMm(depth_mm), depth_mm);
  return LightOf(geometry_.Trace(geometry_.RayAt(point_px, {0, 0}), block.layers).layer, ray);
}

template <typename Light>
Eigen::Array3d ScenePhotograph::MeanOf(const RaySet& set, const Eigen::Vector2d& centre_px,
                                       const Light& light) const {
  const Eigen::Vector2d slope = geometry_.RayAt(centre_px, {0, 0}).slope;
  const bool falloff = on_.Has(Effect::kFalloff);
  Eigen::ArrayXf weights;
  if (falloff) weights = Weights(set, centre_px);
  // In parts: many numbers are not added up in float.
  constexpr std::size_t kPart = 32;
  Eigen::Array4d sum(0, 0, 0, 0);
  for (std::size_t first = 0; first < set.rays.size(); first += kPart) {
    Eigen::Array4f part(0, 0, 0, 0);
    for (std::size_t i = first; i < std::min(first + kPart, set.rays.size()); ++i) {
      const PreparedRay& prepared = set.rays[i];
      const float weight = falloff ? weights(static_cast<Eigen::Index>(i)) : 1;
      part += weight * light(SceneRay{prepared.aperture_mm, slope + prepared.slope});
    }
    sum += part.cast<double>();
  }
  return sum.head<3>() / static_cast<double>(set.rays.size());
}

Eigen::Array3d ScenePhotograph::PixelAt(int x, int y) const {
  const std::size_t index = survey_.IndexAt(x, y);
  const SceneBlock& block = survey_.blocks()[index];
  const RaySet& set = sets_[set_of_block_[index]];
  const Eigen::Vector2d centre_px(x, y);
  if (block.layers.size() == 1) {
    const std::size_t only = block.layers.front();
    const SceneLayer& layer = geometry_.layers()[only];
    if (!layer.gloss.empty()) {
      return MeanOf(set, centre_px, [&](const SceneRay& ray) { return LightOf(only, ray); });
    }
    const SceneTexture& texture = textures_[only];
    return MeanOf(set, centre_px, [&](const SceneRay& ray) {
      const Eigen::Vector2d at_mm = ray.PositionMm(HitDepthMm(layer.plane, ray));
      return texture.At(at_mm.x(), at_mm.y());
    });
  }
  if (on_.Has(Effect::kOcclusion)) {
    return MeanOf(set, centre_px, [&](const SceneRay& ray) { return LightAlong(block, ray); });
  }
  const SceneHit shown = geometry_.Trace(geometry_.RayAt(centre_px, {0, 0}), block.layers);
  const PlaneOptions& surface = geometry_.layers()[shown.layer].plane;
  return MeanOf(set, centre_px,
                [&](const SceneRay& ray) { return LightWithoutOcclusion(block, surface, ray); });
}

}  // namespace thicklens::model
