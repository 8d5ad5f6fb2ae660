#include "tools/bench/bench_scene.h"

#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "thicklens/model/camera.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/scene.h"
#include "thicklens/model/scene_simulator.h"
#include "thicklens/model/thick_lens.h"

namespace thicklens::tools {
namespace {

constexpr double kFocusDepthMm = 1000;
constexpr double kNearMm = 750, kFarMm = 1500;

// A plane of this slope is linear in 1/z over the image: (1 - slope tan)/depth.
model::PlaneOptions SlantedPlane(const model::Camera& camera) {
  const double left = 1 / kNearMm, right = 1 / kFarMm;
  const double half_width = (camera.sensor.width_px - 1) / 2.0 / camera.focal_scale_px();
  model::PlaneOptions plane;
  plane.depth_mm = 2 / (left + right);
  plane.slope = {(left - right) / (left + right) / std::max(half_width, 1e-6), 0};
  return plane;
}

}  // namespace

model::LightField GreyViews(const model::LightField& colours) {
  model::LightField grey =
      model::MakeLightField(colours.s_count, colours.t_count, colours.u_count, colours.v_count, 1);
  grey.weights = colours.weights;
  grey.transfer = colours.transfer;
  grey.grid = colours.grid;
  grey.camera = colours.camera;
  grey.landing_step_px = colours.landing_step_px;
  for (int l = 0; l < colours.v_count; ++l) {
    for (int k = 0; k < colours.u_count; ++k)
      model::SetView(&grey, k, l, model::ToGrey(model::ViewImage(colours, k, l)));
  }
  return grey;
}

model::Camera BenchCamera(int width_px, int height_px) {
  model::Camera camera;
  camera.name = "bench";
  camera.lens.front_focal_length_mm = camera.lens.rear_focal_length_mm = 12.5;
  camera.lens.aperture_radius_mm = 4.46;
  camera.sensor.width_px = width_px;
  camera.sensor.height_px = height_px;
  camera.sensor.pixel_pitch_mm = 0.0028;
  camera.sensor.principal_point_px = {(width_px - 1) / 2.0, (height_px - 1) / 2.0};
  camera.sensor.transfer = model::TransferCurve::Srgb();
  camera.calibration.emplace();
  camera.calibration->image_distance_mm =
      model::Estimate{model::ImageDistanceMm(camera.lens, kFocusDepthMm), 0};
  camera.calibration->blur_ratio = model::Estimate{0.45, 0};
  camera.calibration->evidence.method = "assumed";
  return camera;
}

namespace {

model::SceneLayer GreyLayer(model::TextureKind texture) {
  model::SceneLayer layer;
  layer.texture.kind = texture;
  layer.texture.saturation = 0;
  return layer;
}

model::SceneSimulationOptions SceneOf(const model::Camera& camera,
                                      std::vector<model::SceneLayer> layers, int u_count,
                                      int v_count, std::uint64_t seed) {
  model::SceneSimulationOptions options;
  options.camera = camera;
  options.noise_sigma_grey_levels = 1;
  options.u_count = u_count;
  options.v_count = v_count;
  options.seed = seed;
  options.layers = std::move(layers);
  return options;
}

BenchScene SimulateInGrey(const model::SceneSimulationOptions& options,
                          const model::SceneRun& run) {
  BenchScene scene =
      SimulateBenchScene(options, std::vector<model::LayerPixels>(options.layers.size()), run);
  scene.truth = GreyViews(scene.truth);
  scene.input.image = model::ToGrey(scene.input.image);
  return scene;
}

}  // namespace

model::SceneSimulationOptions SlantedScene(const model::Camera& camera, int u_count, int v_count,
                                           std::uint64_t seed) {
  model::SceneLayer plane = GreyLayer(model::TextureKind::kNoise);
  plane.plane = SlantedPlane(camera);
  return SceneOf(camera, {plane}, u_count, v_count, seed);
}

model::SceneSimulationOptions CardsScene(const model::Camera& camera, int u_count, int v_count,
                                         std::uint64_t seed) {
  model::SceneLayer wall = GreyLayer(model::TextureKind::kNoise);
  wall.plane.depth_mm = 1200;
  std::vector<model::SceneLayer> layers = {wall};
  const double width_px = camera.sensor.width_px, height_px = camera.sensor.height_px;
  for (int i = 0; i < 3; ++i) {
    model::SceneLayer card = GreyLayer(model::TextureKind::kDeadLeaves);
    card.plane.depth_mm = 700 + 100 * i;
    card.outline.shape = model::OutlineOptions::Shape::kRectangle;
    card.outline.unit = model::OutlineOptions::Unit::kPx;
    card.outline.centre = {(0.2 + 0.3 * i) * width_px, (0.35 + 0.15 * i) * height_px};
    card.outline.size = {0.18 * width_px, 0.3 * height_px};
    layers.push_back(card);
  }
  return SceneOf(camera, layers, u_count, v_count, seed);
}

BenchScene SimulateBenchScene(const model::SceneSimulationOptions& options,
                              const std::vector<model::LayerPixels>& pixels,
                              const model::SceneRun& run) {
  const model::SceneSimulator simulator(options, pixels, run.threads);
  // The simulated camera contains the true values of the scene's file.
  const model::Camera& camera = simulator.camera();
  BenchScene scene;
  scene.truth = simulator.RenderLightField(options.u_count, options.v_count, run);
  estimator::EstimateInput& input = scene.input;
  input.camera = camera;
  input.transfer = camera.sensor.transfer;
  input.image = model::ToLinear(simulator.Store(simulator.RenderNoiseless(run)), input.transfer);
  input.grid = model::DefaultGrid(camera, options.u_count, options.v_count);
  input.weights =
      model::ApertureWeights(model::ApertureShapeOf(camera.psf), options.u_count, options.v_count);
  input.disparity = estimator::DisparityOnGrid(*input.grid, simulator.RenderDepth().values,
                                               camera.sensor.width_px, camera.sensor.height_px);
  return scene;
}

BenchScene MakeBenchScene(int width_px, int height_px, int u_count, int v_count, std::uint64_t seed,
                          int threads, const std::function<void(int done, int total)>& progress) {
  return MakeBenchScene(BenchCamera(width_px, height_px), u_count, v_count, seed, threads,
                        progress);
}

BenchScene MakeBenchScene(const model::Camera& camera, int u_count, int v_count, std::uint64_t seed,
                          int threads, const std::function<void(int done, int total)>& progress) {
  return SimulateInGrey(SlantedScene(camera, u_count, v_count, seed), {threads, progress});
}

BenchScene MakeOccludedScene(int width_px, int height_px, int u_count, int v_count,
                             std::uint64_t seed, int threads,
                             const std::function<void(int done, int total)>& progress) {
  return SimulateInGrey(CardsScene(BenchCamera(width_px, height_px), u_count, v_count, seed),
                        {threads, progress});
}

BenchScene PartOf(const BenchScene& scene, const model::PixelRect& part) {
  const estimator::EstimateInput& whole = scene.input;
  BenchScene cut;
  if (scene.has_truth()) cut.truth = model::CropViews(scene.truth, part);
  cut.input = whole;
  cut.input.image = model::CropImage(whole.image, part);
  if (whole.camera) cut.input.camera = model::CropCamera(*whole.camera, part);
  if (whole.falloff_camera) {
    cut.input.falloff_camera = model::CropCamera(*whole.falloff_camera, part);
  }
  if (cut.input.grid) {
    cut.input.grid->s_count = part.width;
    cut.input.grid->t_count = part.height;
    cut.input.grid->st_origin_index -= Eigen::Vector2d(part.x, part.y);
  }
  cut.input.disparity.width_px = part.width;
  cut.input.disparity.height_px = part.height;
  cut.input.disparity.disparity.clear();
  for (int y = part.y; y < part.y + part.height; ++y) {
    const auto row = whole.disparity.disparity.begin() +
                     static_cast<std::ptrdiff_t>(y) * whole.image.width_px + part.x;
    cut.input.disparity.disparity.insert(cut.input.disparity.disparity.end(), row,
                                         row + part.width);
  }
  return cut;
}

BenchScene MiddleOf(const BenchScene& scene, int width_px, int height_px) {
  const model::LinearImage& image = scene.input.image;
  return PartOf(scene, {(image.width_px - width_px) / 2, (image.height_px - height_px) / 2,
                        width_px, height_px});
}

}  // namespace thicklens::tools
