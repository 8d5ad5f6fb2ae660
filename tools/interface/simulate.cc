#include "thicklens/simulate.h"

#include <cstddef>
#include <filesystem>
#include <mutex>
#include <string>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/utc_time.h"
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

OutputFolder ClaimSweepFolder(const std::string& folder) {
  return OutputFolder(folder, kTruthFile,
                      {"frames", "sweep.yaml", "readings.csv", "camera.yaml", kTruthFile,
                       kAblationPage, kAblationTable});
}

SimulatedSweep SimulateSweep(const SweepSimulation& simulation, OutputFolder* folder,
                             bool unknown_offset, const RunControl& control) {
  checks::RequireValid(control);
  if (folder == nullptr) throw Error("folder: a claimed folder is expected, found null");
  const RunScope run(control);
  const model::SweepSimulator simulator(simulation, io::ReadTargetImage(simulation.target));
  const auto& frames = simulator.truth().frames;
  const int count = static_cast<int>(frames.size());
  const auto progress = run.ProgressOf("rendering");
  std::mutex mutex;
  int done = 0, bits = 0;
  ParallelFor(count, control.threads, [&](int i) {
    const model::EncodedImage stored = simulator.RenderFrame(i);
    folder->Write(frames[static_cast<std::size_t>(i)].image, io::EncodePng(stored));
    const std::lock_guard<std::mutex> lock(mutex);
    bits = stored.bits;
    progress(++done, count);
  });
  Camera camera = simulator.camera();
  camera.calibration.reset();  // a calibration of this sweep must find it
  folder->Write("camera.yaml", model::CameraToYaml(model::WithoutMeasuredPsf(camera)));
  const model::SweepFile description = io::DescribeSweep(simulation, simulator, unknown_offset);
  folder->Write("sweep.yaml", model::SweepToYaml(description));
  if (description.readings_are_counts)
    folder->Write("readings.csv", model::ReadingsTable(description));
  folder->Write(kTruthFile, model::SweepTruthToYaml(simulator.truth()));
  return {simulator.truth(), simulator.effects(), bits};
}

Sweep SimulateSweep(const SweepSimulation& simulation, const std::string& folder,
                    bool unknown_offset, const RunControl& control) {
  checks::RequireValid(control);
  OutputFolder output = ClaimSweepFolder(folder);
  SimulateSweep(simulation, &output, unknown_offset, control);
  {
    const RunScope run(control);
    ThrowIfCancelled();
  }
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
          simulator.effects(),
          simulator.sampling_error_grey_levels(),
          simulator.mean_rays_per_pixel()};
}

LightField SimulateLightField(const SceneSimulation& simulation, const RunControl& control,
                              SimulatedScene* scene) {
  checks::RequireValid(control);
  const RunScope run(control);
  const model::SceneSimulator simulator(simulation, io::ReadScenePixels(simulation),
                                        control.threads);
  if (scene != nullptr) {  // before the views, which need much memory
    *scene = {simulator.Truth(simulator.RenderDepth()), simulator.effects_of_views()};
  }
  LightField light_field =
      simulator.RenderLightField(simulation.u_count, simulation.v_count, SceneRunOf(run));
  light_field.origin.version = LibraryVersion();
  light_field.origin.date = NowIso8601();
  return light_field;
}

}  // namespace thicklens
