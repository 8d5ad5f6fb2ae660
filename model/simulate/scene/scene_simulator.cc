#include "thicklens/model/scene_simulator.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <mutex>
#include <optional>
#include <utility>

#include "model/base/random_draws.h"
#include "model/optics/airy.h"
#include "model/simulate/scene/ray_set.h"
#include "model/simulate/scene/scene_geometry.h"
#include "model/simulate/scene/scene_photograph.h"
#include "model/simulate/scene/scene_survey.h"
#include "model/simulate/scene/scene_texture.h"
#include "model/simulate/sensor_noise.h"
#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/parallel.h"
#include "thicklens/model/light_field_grid.h"

namespace thicklens::model {
namespace {

// Maximum distance of a view from the middle of the aperture, in its standard deviations. The
// planes are checked up to there.
constexpr double kFarthestDeviations = 6;
// Textures are drawn up to this number of standard deviations and repeat themselves beyond it.
constexpr double kDrawnDeviations = 4;
constexpr int kAiryViewRays = 256;

const EffectSet kOfViews = {Effect::kPixelBox, Effect::kLensFloor, Effect::kDiffraction};

EffectConditions ConditionsOf(const SceneSimulationOptions& options) {
  EffectConditions conditions;
  conditions.camera = options.camera;
  conditions.wavelength_mm = options.wavelength_mm;
  conditions.bits = options.bits;
  conditions.encoded_noise_grey_levels = options.noise_sigma_grey_levels;
  conditions.full_well_electrons = options.full_well_electrons;
  conditions.read_noise_electrons = options.read_noise_electrons;
  return conditions;
}

// The crossing of the rays of a view with the aperture: that of the ray of the principal point, and
// its displacement per px from it.
struct Viewpoint {
  Eigen::Vector2d aperture_mm;
  double wander_mm_per_px = 0;
};

}  // namespace

struct SceneSimulator::Impl {
  Impl(const SceneSimulationOptions& given, const std::vector<LayerPixels>& pixels, int threads)
      : options(Checked(given)), geometry(options, pixels) {
    MakeTextures(pixels, threads);
    Decide(threads);
    MakeViewRays();
    photograph.emplace(options, geometry, textures, *survey, decision.on, camera.sensor.transfer);
  }

  static const SceneSimulationOptions& Checked(const SceneSimulationOptions& given) {
    std::string why;
    if (!given.IsValid(&why)) throw Error(why);
    return given;
  }

  // Upper bound of the spread by box, floor and diffraction, before the effects are decided.
  double LandingPx() const {
    const double floor_px = geometry.floor_px();
    const EffectSelectionOptions& choice = options.effects;
    const bool without_floor = choice.without.Has(Effect::kLensFloor) ||
                               (choice.base == EffectSelectionOptions::Base::kGiven &&
                                !choice.given.Has(Effect::kLensFloor));
    const double airy_px = AiryRadiusPx(options.camera, options.wavelength_mm);
    RaySpread spread;
    if (floor_px > 0 && !without_floor) {
      spread.gaussian_px = floor_px;
    } else if (options.camera.psf == Psf::kDisc) {
      spread.airy_px = airy_px;
    } else {
      spread.gaussian_px = airy_px / kGaussianAiryRadius;
    }
    return FarthestLandingPx(spread);
  }

  void Decide(int threads) {
    const double landing_px = LandingPx();
    survey.emplace(options.camera, geometry, textures, landing_px, threads);
    EffectSelectionOptions choice = options.effects;
    // These effects cost nothing and determine the format of the written file.
    choice.kept = choice.kept.With({Effect::kQuantisation, Effect::kTransferCurve});
    decision =
        SelectEffects(choice, ConditionsOf(options), survey->Places(), ImageEffects(), threads);
    camera = options.camera;
    if (!On(Effect::kTransferCurve)) camera.sensor.transfer = TransferCurve::Linear();
  }

  // A view is seen through a point of the aperture, so that the blur of the photograph does not
  // conceal the effects of box, floor and diffraction. With kAuto they are on because they cost
  // nothing.
  void MakeViewRays() {
    of_views = decision.on.Both(kOfViews);
    if (options.effects.base == EffectSelectionOptions::Base::kAuto) {
      of_views = kOfViews.Without(options.effects.without);
    }
    const RaySpread spread = SpreadOf(options, of_views);
    view_rays = spread.airy_px > 0 ? PhotographRays(spread, kAiryViewRays)
                                   : ViewRays(spread.box, spread.gaussian_px);
  }

  bool On(Effect effect) const { return decision.on.Has(effect); }

  Eigen::Array3d ViewAt(int x, int y, const Viewpoint& from) const {
    Eigen::Array4d sum(0, 0, 0, 0);
    for (const PixelRay& sample : view_rays) {
      const Eigen::Vector2d position_px = Eigen::Vector2d(x, y) + sample.offset_px;
      const Eigen::Vector2d wander_mm =
          from.wander_mm_per_px * (position_px - geometry.sensor().principal_point_px);
      const SceneRay ray = geometry.RayAt(position_px, from.aperture_mm + wander_mm);
      const SceneHit hit = geometry.Trace(ray);
      sum +=
          LayerLight(geometry, textures[hit.layer], hit.layer, ray, hit.on_texture).cast<double>();
    }
    return sum.head<3>() / static_cast<double>(view_rays.size());
  }

  // With ST in the plane of focus, s = (x - cx) ds for each view, and [S10] is a = ((zl + d0) u -
  // zl s)/d0.
  Viewpoint ViewpointOf(const LightFieldGrid& grid, int k, int l) const {
    Ray ray = grid.RayAt(0, 0, k, l);
    ray.s_mm = ray.t_mm = 0;
    return {ApertureCrossingMm(grid.planes, ray),
            -grid.planes.uv_depth_mm / grid.planes.plane_spacing_mm * grid.s_step_mm};
  }

  // Throws Error if a view sees beyond the drawn textures.
  void CheckReach(const LightFieldGrid& grid) const {
    const double reach_mm = kDrawnDeviations * geometry.aperture_sigma_mm();
    const Viewpoint corner = ViewpointOf(grid, 0, 0);
    const Sensor& sensor = geometry.sensor();
    const Eigen::Vector2d last_px(sensor.width_px - 1, sensor.height_px - 1);
    const Eigen::Vector2d beside_px = sensor.principal_point_px.cwiseAbs().cwiseMax(
        (last_px - sensor.principal_point_px).cwiseAbs());
    const double around_px = 0.5 + kFarthestDeviations * geometry.floor_px();
    const double farthest_mm = (corner.aperture_mm.cwiseAbs().array() +
                                std::abs(corner.wander_mm_per_px) * (beside_px.array() + around_px))
                                   .maxCoeff();
    if (corner.wander_mm_per_px == 0 || farthest_mm <= reach_mm) return;
    throw Error(fmt::format(
        "uv_depth_mm is {}: rays of the outermost views would cross the aperture {:.4g} mm from "
        "its middle, more than {:g} standard deviations (kappa r) of {:.4g} mm, but textures are "
        "not drawn for rays beyond that: a UV plane nearer to the aperture (0) or fewer views are "
        "needed",
        grid.planes.uv_depth_mm, farthest_mm, kDrawnDeviations, geometry.aperture_sigma_mm()));
  }

  // Calls work(row) for every row, on the threads of the run.
  static void ForRows(int count, const SceneRun& run, const std::function<void(int)>& work) {
    std::mutex mutex;
    int done = 0;
    ParallelFor(count, run.threads, [&](int row) {
      work(row);
      if (!run.progress) return;
      const std::lock_guard<std::mutex> lock(mutex);
      run.progress(++done, count);
    });
  }

  // Returns an image with the pixels light(x, y).
  template <typename Light>
  LinearImage Render(const SceneRun& run, const Light& light) const {
    const Sensor& sensor = geometry.sensor();
    LinearImage image{sensor.width_px, sensor.height_px, 3, {}};
    image.values.resize(3 * static_cast<std::size_t>(sensor.width_px) *
                        static_cast<std::size_t>(sensor.height_px));
    ForRows(sensor.height_px, run, [&](int y) {
      float* value = image.values.data() +
                     3 * static_cast<std::size_t>(y) * static_cast<std::size_t>(sensor.width_px);
      for (int x = 0; x < sensor.width_px; ++x) {
        const Eigen::Array3d rgb = light(x, y);
        for (int c = 0; c < 3; ++c) *value++ = static_cast<float>(rgb(c));
      }
    });
    return image;
  }

  void MakeTextures(const std::vector<LayerPixels>& pixels, int threads) {
    const LayerPixels none;
    std::vector<std::optional<SceneTexture>> drawn(options.layers.size());
    const int in_texture =
        std::max(1, ResolveThreads(threads) / static_cast<int>(options.layers.size()));
    ParallelFor(static_cast<int>(drawn.size()), threads, [&](int index) {
      const auto i = static_cast<std::size_t>(index);
      const SceneLayer& layer = options.layers[i];
      const std::string place = LayerPlace(i, layer);
      if (!layer.depth) geometry.CheckPlane(place, layer.plane);
      RandomDraws draws(options.seed, RandomDraws::Purpose::kTexture,
                        static_cast<std::uint32_t>(i));
      try {
        drawn[i].emplace(layer.texture, geometry.RequestFor(i),
                         (i < pixels.size() ? pixels[i] : none).texture, &draws, in_texture);
      } catch (const Interrupted&) {
        throw;
      } catch (const Error& error) {
        throw Error(place + ": " + error.what());
      }
    });
    for (std::optional<SceneTexture>& texture : drawn) textures.push_back(std::move(*texture));
  }

  const SceneSimulationOptions options;
  const SceneGeometry geometry;
  std::vector<SceneTexture> textures;  // one per layer
  std::optional<SceneSurvey> survey;
  EffectSelection decision;
  Camera camera;
  EffectSet of_views;
  std::vector<PixelRay> view_rays;
  std::optional<ScenePhotograph> photograph;
};

SceneSimulator::SceneSimulator(const SceneSimulationOptions& options,
                               const std::vector<LayerPixels>& pixels, int threads)
    : impl_(std::make_unique<Impl>(options, pixels, threads)) {}

SceneSimulator::~SceneSimulator() = default;

const EffectSelection& SceneSimulator::effects() const { return impl_->decision; }

const EffectSet& SceneSimulator::effects_of_views() const { return impl_->of_views; }

double SceneSimulator::sampling_error_grey_levels() const {
  return impl_->photograph->sampling_error_grey_levels();
}

double SceneSimulator::mean_rays_per_pixel() const {
  return impl_->photograph->mean_rays_per_pixel();
}

const Camera& SceneSimulator::camera() const { return impl_->camera; }

LinearImage SceneSimulator::RenderNoiseless(const SceneRun& run) const {
  return impl_->Render(run, [this](int x, int y) { return impl_->photograph->PixelAt(x, y); });
}

EncodedImage SceneSimulator::Store(const LinearImage& noiseless) const {
  const SceneSimulationOptions& options = impl_->options;
  LinearImage exposed = noiseless;
  AddSensorNoise({options.full_well_electrons, options.read_noise_electrons}, impl_->decision.on,
                 options.seed, 0, &exposed);
  return ToEncodedWithNoise(
      exposed, impl_->camera.sensor.transfer, impl_->On(Effect::kQuantisation) ? options.bits : 16,
      impl_->On(Effect::kReadNoise) ? options.noise_sigma_grey_levels / 255 : 0, options.seed);
}

RawDepthMap SceneSimulator::RenderDepth() const {
  const Sensor& sensor = impl_->geometry.sensor();
  RawDepthMap map{sensor.width_px, sensor.height_px, {}, false};
  map.values.reserve(static_cast<std::size_t>(sensor.width_px) *
                     static_cast<std::size_t>(sensor.height_px));
  for (int y = 0; y < sensor.height_px; ++y) {
    ThrowIfCancelled();
    for (int x = 0; x < sensor.width_px; ++x) {
      const SceneHit hit =
          impl_->geometry.Trace(impl_->geometry.RayAt(Eigen::Vector2d(x, y), {0, 0}));
      map.values.push_back(static_cast<float>(hit.depth_mm));
    }
  }
  return map;
}

SceneTruth SceneSimulator::Truth(const RawDepthMap& depth) const {
  const Camera& camera = impl_->options.camera;
  SceneTruth truth;
  truth.image_distance_mm = camera.image_distance_mm();
  truth.focus_depth_mm = camera.focus_depth_mm();
  truth.blur_ratio = camera.blur_ratio();
  truth.blur_floor_px = impl_->geometry.floor_px();
  truth.effects = RecordOf(impl_->decision);
  truth.sampling_error_grey_levels = impl_->photograph->sampling_error_grey_levels();
  truth.seed = impl_->options.seed;
  const auto [nearest, farthest] = std::minmax_element(depth.values.begin(), depth.values.end());
  truth.nearest_depth_mm = static_cast<double>(*nearest);
  truth.farthest_depth_mm = static_cast<double>(*farthest);
  // The only minimum of r_defocus is in the plane of focus, so that its maximum is at one of the
  // two ends.
  for (const double depth_mm : {truth.nearest_depth_mm, truth.farthest_depth_mm}) {
    const double radius_mm = BlurRadiusMm(camera.lens, truth.image_distance_mm, depth_mm);
    truth.largest_blur_sigma_px = std::max(
        truth.largest_blur_sigma_px, truth.blur_ratio * radius_mm / camera.sensor.pixel_pitch_mm);
  }
  return truth;
}

LinearImage SceneSimulator::RenderView(const Eigen::Vector2d& aperture_mm,
                                       const SceneRun& run) const {
  const double reach_mm = kFarthestDeviations * impl_->geometry.aperture_sigma_mm();
  if (!(aperture_mm.cwiseAbs().array() <= reach_mm).all()) {
    throw Error(fmt::format("aperture position [{}, {}] mm: both must be from {} to {}",
                            aperture_mm.x(), aperture_mm.y(), -reach_mm, reach_mm));
  }
  return impl_->Render(run, [&](int x, int y) { return impl_->ViewAt(x, y, {aperture_mm, 0}); });
}

LightField SceneSimulator::RenderLightField(int u_count, int v_count, const SceneRun& run) const {
  const Camera& camera = impl_->options.camera;
  const double uv_depth_mm = impl_->options.uv_depth_mm;
  // DefaultGrid throws Error for a focus at infinity, where ST would be.
  LightFieldGrid grid = DefaultGrid(camera, u_count, v_count);
  if (uv_depth_mm != 0) {
    grid = GridOnPlanes(camera, {uv_depth_mm, camera.focus_depth_mm() - uv_depth_mm}, u_count,
                        v_count);
  }
  impl_->CheckReach(grid);
  LightField light_field = MakeLightField(grid.s_count, grid.t_count, u_count, v_count, 3);
  light_field.weights = ApertureWeights(ApertureShapeOf(camera.psf), u_count, v_count);
  light_field.transfer = impl_->camera.sensor.transfer;
  light_field.grid = grid;
  light_field.camera = impl_->camera;
  light_field.origin.method = "simulated";
  light_field.origin.effects = impl_->of_views.Names();
  // Sample (i, j) of the plane of focus is on the ray of pixel (i, j) for every view: Q = 0.
  Impl::ForRows(u_count * v_count * grid.t_count, run, [&](int row) {
    const int y = row % grid.t_count;
    const int view = row / grid.t_count;
    const Viewpoint from = impl_->ViewpointOf(grid, view % u_count, view / u_count);
    for (int x = 0; x < grid.s_count; ++x) {
      const Eigen::Array3d rgb = impl_->ViewAt(x, y, from);
      for (int c = 0; c < 3; ++c) {
        light_field.values[light_field.ViewStart(c, view % u_count, view / u_count) +
                           static_cast<std::size_t>(y * grid.s_count + x)] =
            static_cast<float>(rgb(c));
      }
    }
  });
  return light_field;
}

}  // namespace thicklens::model
