#include "thicklens/simulate.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <ctime>
#include <filesystem>
#include <mutex>
#include <utility>

#include "thicklens/base/output_file.h"
#include "thicklens/base/parallel.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/scene_pixels.h"
#include "thicklens/io/simulated_sweep.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/version.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/validation.h"

namespace thicklens {
namespace {

constexpr char kTruthFile[] = "truth.yaml";  // marks a folder that this library may replace

model::SceneRun SceneRunOf(const RunScope& run) {
  return {run.threads(), run.ProgressOf("rendering")};
}

}  // namespace

SweepSimulation ReadSweepSimulation(const std::string& path) {
  return model::ReadSweepSimulation(path);
}
SceneSimulation ReadSceneSimulation(const std::string& path) {
  return model::ReadSceneSimulation(path);
}

Sweep SimulateSweep(const SweepSimulation& simulation, const std::string& folder,
                    bool unknown_offset, const RunControl& control) {
  checks::RequireValid(control);
  const RunScope run(control);
  OutputFolder output(
      folder, kTruthFile,
      {"frames", "sweep.yaml", "camera.yaml", kTruthFile, "attribution.html", "attribution.csv"});
  const model::SweepSimulator simulator(simulation, io::ReadTargetImage(simulation.target));
  const auto& frames = simulator.truth().frames;
  const int count = static_cast<int>(frames.size());
  const auto progress = run.ProgressOf("rendering");
  std::mutex mutex;
  int done = 0;
  ParallelFor(count, control.threads, [&](int i) {
    output.Write(frames[static_cast<std::size_t>(i)].image,
                 io::EncodePng(simulator.RenderFrame(i)));
    const std::lock_guard<std::mutex> lock(mutex);
    progress(++done, count);
  });
  Camera camera = simulator.camera();
  camera.calibration.reset();  // what a calibration of this sweep has to find
  output.Write("camera.yaml", model::CameraToYaml(camera));
  output.Write("sweep.yaml",
               model::SweepToYaml(io::DescribeSweep(simulation, simulator, unknown_offset)));
  output.Write(kTruthFile, model::SweepTruthToYaml(simulator.truth()));
  ThrowIfCancelled();
  output.Commit();
  return ReadSweep((std::filesystem::path(folder) / "sweep.yaml").string());
}

SimulatedPhotograph SimulatePhotograph(const SceneSimulation& simulation,
                                       const RunControl& control) {
  checks::RequireValid(control);
  const RunScope run(control);
  const model::SceneSimulator simulator(simulation, io::ReadScenePixels(simulation),
                                        control.threads);
  model::RawDepthMap depth = simulator.RenderDepth();
  const model::SceneTruth truth = simulator.Truth(depth);
  const model::LinearImage light = simulator.RenderNoiseless(SceneRunOf(run));
  model::EncodedImage stored = simulator.Store(light);
  return {Image::FromEncoded(stored.width_px, stored.height_px, ChannelOrder::kRgb, stored.bits,
                             std::move(stored.values), simulator.camera().sensor.transfer),
          {depth.width_px,
           depth.height_px,
           std::move(depth.values),
           depth.integer,
           {DepthKind::kZ, LengthUnit::kMillimetre},
           ""},
          simulator.camera(),
          truth,
          simulator.effects()};
}

LightField SimulateLightField(const SceneSimulation& simulation, const RunControl& control) {
  checks::RequireValid(control);
  const RunScope run(control);
  const model::SceneSimulator simulator(simulation, io::ReadScenePixels(simulation),
                                        control.threads);
  LightField light_field =
      simulator.RenderLightField(simulation.u_count, simulation.v_count, SceneRunOf(run));
  light_field.origin.version = LibraryVersion();
  light_field.origin.date = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  return light_field;
}

}  // namespace thicklens
