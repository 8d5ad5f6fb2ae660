#include "model/simulate/scene/scene_photograph.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>

#include "model/optics/airy.h"
#include "model/optics/ray_irradiance.h"
#include "model/simulate/scene/sampling_plan.h"

namespace thicklens::model {

static_assert(kRaysAtOnce <= SceneTexture::kMaxAtOnce);

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
  // A measured floor includes the diffraction.
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
    : geometry_(geometry), textures_(textures), survey_(survey), blocks_(survey.blocks()), on_(on) {
  // The image distance of the thin lens of the same focus is K.
  irradiance_distance_mm_ = on.Has(Effect::kThickness) ? options.camera.image_distance_mm()
                                                       : options.camera.focal_scale_px() *
                                                             geometry.sensor().pixel_pitch_mm;
  MakeSets(options, stored);
}

// The survey ignores the choice of effects. Without occlusion the middle of the aperture determines
// which layer is visible at the points where rays meet the surface that a pixel shows. The search
// therefore covers all positions that these rays reach.
std::vector<std::size_t> ScenePhotograph::LayersFor(const ImageRegion& region,
                                                    const RaySpread& spread) const {
  const double landing_px = FarthestLandingPx(spread), deviations = FarthestDeviations(spread);
  if (on_.Has(Effect::kOcclusion)) return MetLayers(geometry_, region, landing_px, deviations);
  double farthest_px = landing_px;
  for (const std::size_t surface : MetLayers(geometry_, region, 0, 0)) {
    farthest_px =
        std::max(farthest_px, ReachPx(geometry_, surface, region, landing_px, deviations));
  }
  return MetLayers(geometry_, region, farthest_px, 0);
}

void ScenePhotograph::LookCloser(const RaySpread& spread) {
  for (SceneBlock& block : blocks_) {
    if (block.layers.size() == 1) continue;
    const ImageRegion region{{block.x0 - 0.5, block.y0 - 0.5}, {block.x1 - 0.5, block.y1 - 0.5}};
    const std::vector<std::size_t> met = LayersFor(region, spread), surveyed = block.layers;
    block.layers.clear();
    std::set_intersection(surveyed.begin(), surveyed.end(), met.begin(), met.end(),
                          std::back_inserter(block.layers));
    if (block.layers.size() > 1 || block.has_folds) continue;
    for (EffectSite& place : block.places) place.jump = 0;
  }
}

void ScenePhotograph::MakeSets(const SceneSimulationOptions& options, const TransferCurve& stored) {
  const RaySpread spread = SpreadOf(options, on_);
  LookCloser(spread);
  SamplingSpread sampling;
  sampling.landing_px = std::sqrt((spread.box ? 1.0 / 12 : 0) + std::pow(spread.gaussian_px, 2));
  sampling.airy_px = spread.airy_px;
  if (!spread.aperture && sampling.landing_px == 0 && spread.airy_px == 0) {
    sets_.push_back(Prepared({PixelRay()}));
    set_of_block_.assign(blocks_.size(), 0);
    return;
  }
  std::map<int, std::size_t> set_of_count;
  for (const SceneBlock& block : blocks_) {
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

double ScenePhotograph::mean_rays_per_pixel() const {
  double rays = 0;
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const SceneBlock& block = blocks_[i];
    rays += static_cast<double>((block.x1 - block.x0) * (block.y1 - block.y0)) *
            static_cast<double>(sets_[set_of_block_[i]].rays.size());
  }
  return rays / (static_cast<double>(geometry_.sensor().width_px) * geometry_.sensor().height_px);
}

// Relative sd over the aperture, from points at +-1 standard deviation on both axes.
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
  std::vector<SceneRay> bundle;
  Eigen::ArrayXf behind_x(count), behind_y(count), exposure(count);
  for (const PixelRay& ray : rays) {
    const auto i = static_cast<Eigen::Index>(bundle.size());
    const Eigen::Vector2d aperture_mm = geometry_.aperture_sigma_mm() * ray.aperture;
    bundle.push_back(geometry_.RayAt(axis_px + ray.offset_px, aperture_mm));
    const Eigen::Vector2d behind_mm = sensor.pixel_pitch_mm * ray.offset_px + aperture_mm;
    behind_x(i) = static_cast<float>(behind_mm.x());
    behind_y(i) = static_cast<float>(behind_mm.y());
    // The blur of a point on the axis is that of the calibration, including fall-off. [S12] is
    // therefore relative to the irradiance of the same part of the aperture at the principal point,
    // where a uniform radiance 1 gives 1.
    exposure(i) =
        static_cast<float>(1 / Irradiance(axis_px, geometry_.RayAt(axis_px, aperture_mm)));
  }
  return {RayBundle(geometry_, bundle, on_.Has(Effect::kOcclusion)), std::move(exposure),
          std::move(behind_x), std::move(behind_y)};
}

double ScenePhotograph::Irradiance(const Eigen::Vector2d& position_px, const SceneRay& ray) const {
  const Sensor& sensor = geometry_.sensor();
  return RayIrradiance(ray.slope, sensor.pixel_pitch_mm * (position_px - sensor.principal_point_px),
                       ray.aperture_mm, irradiance_distance_mm_);
}

// Computes RayIrradiance for all rays of a part at once.
RayNumbers ScenePhotograph::Weights(const RaySet& set, const Eigen::Vector2d& centre_px,
                                    const RayPart& part) const {
  if (!on_.Has(Effect::kFalloff)) return RayNumbers::Ones(part.count);
  const Sensor& sensor = geometry_.sensor();
  const Eigen::Vector2f slope = geometry_.RayAt(centre_px, {0, 0}).slope.cast<float>();
  const Eigen::Vector2f landing_mm =
      (sensor.pixel_pitch_mm * (centre_px - sensor.principal_point_px)).cast<float>();
  const auto per_distance2 =
      static_cast<float>(1 / (irradiance_distance_mm_ * irradiance_distance_mm_));
  const auto of = [&part](const Eigen::ArrayXf& numbers) {
    return numbers.segment(part.first, part.count);
  };
  const RayNumbers alpha = 1 + (of(set.rays.slope_x()) + slope.x()).square() +
                           (of(set.rays.slope_y()) + slope.y()).square();
  const RayNumbers beta = 1 + per_distance2 * ((of(set.behind_x) + landing_mm.x()).square() +
                                               (of(set.behind_y) + landing_mm.y()).square());
  return of(set.exposure) / ((alpha * beta).sqrt() * beta);
}

RayBundle::Shown ScenePhotograph::ShownBy(const Pixel& pixel, const RayPart& part) const {
  const std::vector<std::size_t>& layers = pixel.block.layers;
  if (layers.size() == 1) return {};
  if (on_.Has(Effect::kOcclusion)) {
    return pixel.set.rays.NearestAlong(pixel.centre_px, layers, pixel.chiefs, part);
  }
  const SceneHit hit = geometry_.Trace(geometry_.RayAt(pixel.centre_px, {0, 0}), layers);
  const auto surface = std::find(layers.begin(), layers.end(), hit.layer) - layers.begin();
  return pixel.set.rays.NearestFromMiddle(pixel.centre_px, layers, pixel.chiefs,
                                          static_cast<std::size_t>(surface), part);
}

Eigen::Array4f ScenePhotograph::LayerSum(const Pixel& pixel, std::size_t which,
                                         const RayBundle::Shown& shown, const RayPart& part,
                                         const RayNumbers& weights) const {
  const std::size_t layer = pixel.block.layers[which];
  const ChiefHit& chief = pixel.chiefs[which];
  std::array<Eigen::Index, kRaysAtOnce> showing;
  Eigen::Index count = 0;
  for (Eigen::Index i = 0; i < part.count; ++i) {
    if (shown[static_cast<std::size_t>(i)] == which) {
      showing[static_cast<std::size_t>(count++)] = i;
    }
  }
  if (count == 0) return Eigen::Array4f::Zero();
  RayBundle::Meeting meeting = pixel.set.rays.Meet(layer, chief, part);
  RayNumbers of_these = weights;
  if (count < part.count) {
    for (Eigen::Index i = 0; i < count; ++i) {
      const Eigen::Index ray = showing[static_cast<std::size_t>(i)];
      meeting.x(i) = meeting.x(ray);
      meeting.y(i) = meeting.y(ray);
      of_these(i) = weights(ray);
    }
  }
  if (geometry_.layers()[layer].gloss.empty()) {
    return textures_[layer].SumAround(chief.on_texture, meeting.x.data(), meeting.y.data(),
                                      of_these.data(), static_cast<int>(count));
  }
  Eigen::Array4f sum(0, 0, 0, 0);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Index ray = part.first + showing[static_cast<std::size_t>(i)];
    SceneRay along = pixel.set.rays.rays()[static_cast<std::size_t>(ray)];
    along.slope += chief.slope;
    const Eigen::Vector2d on_texture =
        geometry_.height_field(layer) == nullptr
            ? geometry_.HitOn(layer, along).on_texture
            : chief.on_texture + Eigen::Vector2f(meeting.x(i), meeting.y(i)).cast<double>();
    sum += of_these(i) * LayerLight(geometry_, textures_[layer], layer, along, on_texture);
  }
  return sum;
}

Eigen::Array3d ScenePhotograph::PixelAt(int x, int y) const {
  const std::size_t index = survey_.IndexAt(x, y);
  const SceneBlock& block = blocks_[index];
  Pixel pixel{block, sets_[set_of_block_[index]], {x, y}, {}};
  pixel.chiefs.reserve(block.layers.size());
  for (const std::size_t layer : block.layers) {
    pixel.chiefs.push_back(pixel.set.rays.ChiefAt(pixel.centre_px, layer));
  }
  const Eigen::Index rays = pixel.set.rays.size();
  // Only the numbers of one part are added in float; the parts are added in double.
  Eigen::Array4d sum(0, 0, 0, 0);
  for (Eigen::Index first = 0; first < rays; first += kRaysAtOnce) {
    const RayPart part{first, std::min<Eigen::Index>(kRaysAtOnce, rays - first)};
    const RayNumbers weights = Weights(pixel.set, pixel.centre_px, part);
    const RayBundle::Shown shown = ShownBy(pixel, part);
    for (std::size_t which = 0; which < block.layers.size(); ++which) {
      sum += LayerSum(pixel, which, shown, part, weights).cast<double>();
    }
  }
  return sum.head<3>() / static_cast<double>(rays);
}

}  // namespace thicklens::model
