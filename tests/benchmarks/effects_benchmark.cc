// Measures the cost of each effect of image formation. Images of five typical scenes, 320 x 240
// px, are made without any effect, with one effect alone, with those that matter, and with all. The
// time is that of the whole image, including its textures, survey and noise. `to_none` is the
// processor time relative to that of the same image without effects, and `rays` is the mean
// number of rays per pixel. Run it with ./dev bench --benchmark_filter=Effects/
#include <benchmark/benchmark.h>

#include <algorithm>
#include <ctime>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/model/scene_simulator.h"

namespace thicklens::model {
namespace {

constexpr int kWidth = 320, kHeight = 240;
constexpr int kThreads = 2;

// A thin lens. `floor_px` 0 means that the floor was not measured, so that diffraction is
// simulated.
Camera MakeCamera(double focal_mm, double f_number, double pitch_mm, double focus_mm, Psf psf,
                  double floor_px) {
  Camera camera;
  camera.name = "benchmark";
  camera.lens = {focal_mm, focal_mm, 0, focal_mm / f_number / 2};
  camera.sensor.width_px = kWidth;
  camera.sensor.height_px = kHeight;
  camera.sensor.pixel_pitch_mm = pitch_mm;
  camera.sensor.principal_point_px = {(kWidth - 1) / 2.0, (kHeight - 1) / 2.0};
  camera.sensor.transfer = TransferCurve::Srgb();
  camera.psf = psf;
  camera.calibration.emplace();
  camera.calibration->image_distance_mm = Estimate{focal_mm * focus_mm / (focus_mm - focal_mm), 0};
  camera.calibration->blur_ratio = Estimate{0.45, 0};
  if (floor_px > 0) camera.calibration->blur_floor_px = Estimate{floor_px, 0};
  camera.calibration->evidence.method = "assumed";
  return camera;
}

SceneLayer Leaves(double depth_mm, const Eigen::Vector2d& slope) {
  SceneLayer layer;
  layer.plane = {depth_mm, slope};
  layer.texture.kind = TextureKind::kDeadLeaves;
  layer.texture.feature_size_px = 3;
  return layer;
}

SceneLayer Card(double depth_mm, const Eigen::Vector2d& centre_px, const Eigen::Vector2d& size_px) {
  SceneLayer layer = Leaves(depth_mm, {0, 0});
  layer.outline.shape = OutlineOptions::Shape::kRectangle;
  layer.outline.centre = centre_px;
  layer.outline.size = size_px;
  return layer;
}

SceneLayer Coin(double depth_mm, const Eigen::Vector2d& centre_px, double radius_px) {
  SceneLayer layer = Card(depth_mm, centre_px, {0, 0});
  layer.outline.shape = OutlineOptions::Shape::kDisc;
  layer.outline.radius = radius_px;
  layer.texture.kind = TextureKind::kNoise;
  layer.texture.feature_size_px = 5;
  return layer;
}

SceneSimulationOptions SceneOf(const Camera& camera, std::vector<SceneLayer> layers) {
  SceneSimulationOptions options;
  options.camera = camera;
  options.layers = std::move(layers);
  options.full_well_electrons = 10000;
  options.read_noise_electrons = 5;
  return options;
}

std::vector<std::pair<std::string, SceneSimulationOptions>> Scenes() {
  const Camera macro = MakeCamera(50, 2.8, 0.0045, 300, Psf::kGaussian, 0.5);
  return {
      {"in-focus", SceneOf(macro, {Leaves(300, {0, 0})})},
      {"shallow-macro",
       SceneOf(macro, {Leaves(303.6, {0.45, -0.3}), Card(300, {97, 130}, {113, 140}),
                       Coin(295.6, {223, 87}, 50)})},
      {"wide", SceneOf(MakeCamera(4, 2.8, 0.018, 1500, Psf::kDisc, 0.5),
                       {Leaves(4000, {0.4, 0}), Card(1500, {100, 130}, {90, 120}),
                        Card(900, {240, 170}, {80, 60})})},
      {"small-aperture", SceneOf(MakeCamera(50, 22, 0.0045, 2000, Psf::kDisc, 0),
                                 {Leaves(2300, {0.2, -0.1}), Card(2000, {97, 130}, {113, 140}),
                                  Coin(1800, {223, 87}, 50)})},
      {"deep-occlusions", SceneOf(MakeCamera(50, 2, 0.01, 1500, Psf::kDisc, 0.5),
                                  {Leaves(5000, {0, 0}), Card(2500, {60, 120}, {70, 200}),
                                   Card(2000, {250, 110}, {60, 150}),
                                   Card(1500, {150, 140}, {80, 120}), Coin(1200, {110, 70}, 30),
                                   Card(1000, {210, 190}, {120, 20}), Coin(900, {280, 200}, 25)})},
  };
}

double CpuSeconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

// Makes the image and returns the mean number of rays per pixel.
double MakeImage(const SceneSimulationOptions& options) {
  const SceneSimulator simulator(options, {}, kThreads);
  benchmark::DoNotOptimize(simulator.Store(simulator.RenderNoiseless({kThreads, {}})));
  return simulator.mean_rays_per_pixel();
}

// Processor time, in s, of the scene's image without effects: the minimum of three runs.
double SecondsOfNone(const std::string& scene, SceneSimulationOptions options) {
  static std::map<std::string, double> known;
  const auto found = known.find(scene);
  if (found != known.end()) return found->second;
  options.effects = EffectSelectionOptionsFromText("none", "", "");
  double least = 0;
  for (int i = 0; i < 3; ++i) {
    const double start = CpuSeconds();
    MakeImage(options);
    const double seconds = CpuSeconds() - start;
    least = i == 0 ? seconds : std::min(least, seconds);
  }
  return known[scene] = least;
}

void CostOf(benchmark::State& state, const std::string& scene, SceneSimulationOptions options,
            const std::string& effects) {
  options.effects = EffectSelectionOptionsFromText(effects, "", "");
  const double of_none = SecondsOfNone(scene, options);
  double rays = 0;
  const double start = CpuSeconds();
  for (auto _ : state) rays = MakeImage(options);
  const double seconds = (CpuSeconds() - start) / static_cast<double>(state.iterations());
  state.counters["rays"] = rays;
  state.counters["to_none"] = seconds / of_none;
}

// The benchmarks are registered before main().
const bool kRegistered = [] {
  for (const auto& [scene, options] : Scenes()) {
    std::vector<std::string> rows = {"none"};
    for (const std::string& name : ImageEffects().Names()) rows.push_back(name);
    rows.insert(rows.end(), {"auto", "all"});
    for (const std::string& row : rows) {
      benchmark::RegisterBenchmark(("Effects/" + scene + "/" + row).c_str(), CostOf, scene, options,
                                   row)
          ->MeasureProcessCPUTime()
          ->UseRealTime()
          ->Unit(benchmark::kMillisecond);
    }
  }
  return true;
}();

}  // namespace
}  // namespace thicklens::model
