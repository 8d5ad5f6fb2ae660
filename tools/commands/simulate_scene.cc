// thicklens simulate image, thicklens simulate light-field: simulate a photograph with its depth
// map, and the true light field of the same scene.
#include "tools/commands/simulate_scene.h"

#include <fmt/format.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/deprecation.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/base/utc_time.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_description.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/io/scene_pixels.h"
#include "thicklens/io/simulated_sweep.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/scene_simulator.h"
#include "tools/options/deprecated_names.h"
#include "tools/options/effect_options.h"
#include "tools/options/light_field_options.h"
#include "tools/options/option_values.h"
#include "tools/report/ablation_page.h"
#include "tools/report/ablation_run.h"
#include "tools/system/build_info.h"
#include "tools/system/progress_line.h"

namespace thicklens::tools {
namespace {

// A folder with this file was written by this program, which may replace it.
constexpr char kImageMarker[] = "truth.yaml";

constexpr char kSimulate[] = "simulate ";
constexpr char kImageCommand[] = "image";

struct SceneOptions {
  CommonOptions common;
  std::string config_path;
  std::string output_folder;
  std::optional<std::int64_t> seed;
  EffectOptions effects;
  bool ablate = false;                // image
  std::string sweep_path;             // image; for the ablation
  ViewsOption views;                  // light-field
  std::optional<double> uv_depth_mm;  // light-field
  std::string format = "png";         // light-field
};

model::SceneSimulationOptions ReadConfig(const SceneOptions& options) {
  model::SceneSimulationOptions scene = model::ReadSceneSimulation(options.config_path);
  ReportDeprecated(options.common, scene.notices);
  if (options.seed) scene.seed = static_cast<std::uint64_t>(*options.seed);
  CheckEffectNames(options.effects, model::ImageEffects());
  ApplyEffectOptions(options.effects, &scene.effects);
  const auto [u_count, v_count] = ViewCounts(options.views);
  if (u_count > 0) {
    scene.u_count = u_count;
    scene.v_count = v_count;
  }
  if (options.uv_depth_mm) scene.uv_depth_mm = *options.uv_depth_mm;
  return scene;
}

// Shows progress on the terminal and ends when the user requests it.
model::SceneRun RunWith(const CommonOptions& common, ProgressLine* progress) {
  return {common.threads, [progress](int done, int total) {
            ThrowIfCancelled();
            progress->Show(done, total);
          }};
}

nlohmann::json Summary(const SceneOptions& options, const model::SceneSimulationOptions& scene,
                       const model::SceneTruth& truth, Clock::time_point start) {
  const std::chrono::duration<double> seconds = Clock::now() - start;
  return {{"status", "ok"},
          {"reason", ""},
          {"output", options.output_folder},
          {"width_px", scene.camera.sensor.width_px},
          {"height_px", scene.camera.sensor.height_px},
          {"layers", scene.layers.size()},
          {"seed", scene.seed},
          {"nearest_depth_mm", truth.nearest_depth_mm},
          {"farthest_depth_mm", truth.farthest_depth_mm},
          {"largest_blur_sigma_px", truth.largest_blur_sigma_px},
          {"truth",
           {{"image_distance_mm", truth.image_distance_mm},
            {"focus_depth_mm", truth.focus_depth_mm},
            {"blur_ratio", truth.blur_ratio},
            {"blur_floor_px", truth.blur_floor_px}}},
          {"seconds", seconds.count()}};
}

std::string SamplingText(const model::SceneSimulationOptions& scene,
                         const model::SceneSimulator& simulator) {
  const double error = simulator.sampling_error_grey_levels();
  const double asked = scene.sampling_error_grey_levels;
  return fmt::format("largest sampling error: about {:.2g} grey levels rms{}\n", error,
                     error > asked && asked > 0
                         ? fmt::format(", above the requested {:.2g}: rays_per_pixel is {}", asked,
                                       scene.rays_per_pixel)
                         : "");
}

Ablation Attribute(const SceneOptions& options, const model::SceneSimulationOptions& scene,
                   const std::vector<model::LayerPixels>& pixels) {
  Ablation ablation;
  std::optional<model::SweepSimulationOptions> sweep;
  if (!options.sweep_path.empty()) {  // read before anything that takes long
    sweep = model::ReadSweepSimulation(options.sweep_path);
    ReportDeprecated(options.common, sweep->notices);
    if (options.seed) sweep->seed = static_cast<std::uint64_t>(*options.seed);
  }
  // The sweep is read first, because it may have no calibration to compare with.
  if (sweep) {
    ProgressLine progress("ablating the sweep", options.common.quiet);
    ablation.sweep = AblateSweepOf(options.sweep_path, *sweep, false,
                                   AblationRunWith(options.common, &progress));
  }
  ProgressLine progress("ablating", options.common.quiet);
  ablation.scene = AblateSceneOf(scene, pixels, AblationRunWith(options.common, &progress));
  return ablation;
}

CommandResult SimulateImage(const SceneOptions& options) {
  const auto start = Clock::now();
  const model::SceneSimulationOptions scene = ReadConfig(options);
  OutputFolder folder(
      options.output_folder, kImageMarker,
      {"picture.png", "depth.pfm", "camera.yaml", kImageMarker, kAblationPage, kAblationTable});

  const std::vector<model::LayerPixels> pixels = io::ReadScenePixels(scene);
  const model::SceneSimulator simulator(scene, pixels, options.common.threads);
  const model::RawDepthMap depth = simulator.RenderDepth();
  const model::SceneTruth truth = simulator.Truth(depth);
  int bits = 0;
  {
    ProgressLine progress("rendering", options.common.quiet);
    const model::LinearImage image = simulator.RenderNoiseless(RunWith(options.common, &progress));
    const model::EncodedImage stored = simulator.Store(image);
    bits = stored.bits;
    folder.Write("picture.png",
                 io::WithDescription(io::EncodePng(stored),
                                     fmt::format("simulated; effects: {}",
                                                 model::JoinedNames(simulator.effects().on))));
  }
  folder.Write("depth.pfm", io::EncodePfm(depth));
  folder.Write("camera.yaml", model::CameraToYaml(simulator.camera()));
  folder.Write(kImageMarker, model::SceneTruthToYaml(truth));
  Ablation ablation;
  if (options.ablate) {
    ablation = Attribute(options, scene, pixels);
    WriteAblation(ablation, options.config_path, &folder);
  }
  ThrowIfCancelled();
  folder.Commit();

  CommandResult result;
  result.is_written = true;
  result.summary = Summary(options, scene, truth, start);
  result.summary["bits"] = bits;
  result.summary["effects"] = EffectsJson(simulator.effects());
  result.summary["sampling_error_grey_levels"] = simulator.sampling_error_grey_levels();
  result.summary["rays_per_pixel"] = scene.rays_per_pixel;
  result.summary["mean_rays_per_pixel"] = simulator.mean_rays_per_pixel();
  PrintResult(
      options.common,
      fmt::format("an image of {} x {} px, depths from {:.6g} to {:.6g} mm, blur sigma up "
                  "to {:.3g} px, in {:.1f} s: {}\n",
                  scene.camera.sensor.width_px, scene.camera.sensor.height_px,
                  truth.nearest_depth_mm, truth.farthest_depth_mm, truth.largest_blur_sigma_px,
                  result.summary["seconds"].get<double>(), options.output_folder) +
          EffectsText(simulator.effects()) + SamplingText(scene, simulator) +
          (options.ablate ? AblationText(ablation) : ""));
  if (options.ablate) result.summary["ablation"] = AblationJson(ablation);
  return result;
}

CommandResult SimulateLightField(const SceneOptions& options) {
  const auto start = Clock::now();
  const model::SceneSimulationOptions scene = ReadConfig(options);
  OutputFolder folder(options.output_folder, io::kLightFieldMarker, io::LightFieldEntries());

  const model::SceneSimulator simulator(scene, io::ReadScenePixels(scene), options.common.threads);
  std::size_t clipped = 0;
  {
    ProgressLine progress("rendering", options.common.quiet);
    model::LightField light_field = simulator.RenderLightField(scene.u_count, scene.v_count,
                                                               RunWith(options.common, &progress));
    light_field.origin.version = Version();
    light_field.origin.date = NowIso8601();
    const io::ViewFormat format =
        options.format == "tiff" ? io::ViewFormat::kTiff : io::ViewFormat::kPng;
    clipped = io::WriteLightField(light_field, format, &folder);
  }
  const model::SceneTruth truth = simulator.Truth(simulator.RenderDepth());
  ThrowIfCancelled();
  folder.Commit();

  CommandResult result;
  result.is_written = true;
  result.summary = Summary(options, scene, truth, start);
  result.summary["views"] = {scene.u_count, scene.v_count};
  result.summary["clipped_values"] = clipped;
  result.summary["effects_of_views"] = simulator.effects_of_views().Names();
  PrintResult(
      options.common,
      fmt::format("{} x {} views of {} x {} px in {:.1f} s: {}\n", scene.u_count, scene.v_count,
                  scene.camera.sensor.width_px, scene.camera.sensor.height_px,
                  result.summary["seconds"].get<double>(), options.output_folder) +
          fmt::format("effects of the views: {}\n",
                      model::JoinedNames(simulator.effects_of_views())));
  return result;
}

CLI::App* AddSceneCommand(CLI::App* simulate, const std::string& name, const std::string& help,
                          SceneOptions* options) {
  CLI::App* command = simulate->add_subcommand(name, help);
  command->add_option("config", options->config_path, "Description of the scene")
      ->required()
      ->type_name("CONFIG");
  command->add_option("-o,--output", options->output_folder, "Folder to write")
      ->required()
      ->type_name("DIR");
  command->add_option("--seed", options->seed, "Seed; overrides the one in the config")
      ->check(CLI::Range(std::int64_t{0}, std::numeric_limits<std::int64_t>::max()))
      ->type_name("N");
  AddEffectOptions(command, &options->effects);
  AddCommonOptions(command, &options->common);
  return command;
}

// `name` is the command's present or a former name.
void AddImageCommand(CLI::App* simulate, const std::string& name, CommandAction* action) {
  const auto image = std::make_shared<SceneOptions>();
  CLI::App* command =
      AddSceneCommand(simulate, name,
                      "A photograph of a scene: picture.png, depth.pfm (z in mm), camera.yaml (the "
                      "true calibration) and truth.yaml",
                      image.get());
  command->add_flag(
      "--ablate", image->ablate,
      "Also simulate the image and estimate its light field without each effect in turn, and "
      "report what each effect changes: a table, attribution.csv and the page attribution.html");
  AddDeprecatedFlags(command, "--ablate", &image->ablate, &image->common);
  command
      ->add_option("--sweep", image->sweep_path,
                   "For --ablate: a simulated sweep (as for simulate sweep), to report what "
                   "each effect changes in its calibration")
      ->type_name("SWEEP");
  const bool is_former = name != kImageCommand;
  if (is_former) command->group("");  // hidden in --help
  command->callback([image, name, is_former, action] {
    if (is_former) {
      image->common.deprecated.push_back(
          DeprecationText({kSimulate + name, kSimulate + std::string(kImageCommand)}));
    }
    *action = [image] {
      if (!image->sweep_path.empty() && !image->ablate) {
        throw UsageError("--sweep requires --ablate");
      }
      RequireDistinctFiles({image->common.json_path, image->output_folder},
                           {image->config_path, image->sweep_path});
      RunCommand(image->common, [&] { return SimulateImage(*image); });
    };
  });
}

}  // namespace

void AddSimulateSceneCommands(CLI::App* simulate, CommandAction* action) {
  const std::string now = kImageCommand;
  AddImageCommand(simulate, now, action);
  for (const std::string& former : FormerNames(NameKind::kCommand, kSimulate + now)) {
    AddImageCommand(simulate, former.substr(std::string(kSimulate).size()), action);
  }

  const auto views = std::make_shared<SceneOptions>();
  CLI::App* command = AddSceneCommand(simulate, "light-field",
                                      "The true light field of a scene, as its views", views.get());
  AddViewsOption(command, &views->views, "Number of views across and down; overrides the config");
  command
      ->add_option("--uv-depth", views->uv_depth_mm,
                   "Depth of the UV plane, 0: the aperture; overrides uv_depth_mm of the config")
      ->check(Finite())
      ->type_name("MM");
  command
      ->add_option(
          "--format", views->format,
          "Format of the views: png (16 bit, encoded values) or tiff (float, linear light)")
      ->check(CLI::IsMember({"png", "tiff"}))
      ->capture_default_str()
      ->type_name("NAME");
  command->callback([views, action] {
    *action = [views] {
      RequireDistinctFiles({views->common.json_path, views->output_folder}, {views->config_path});
      RunCommand(views->common, [&] { return SimulateLightField(*views); });
    };
  });
}

}  // namespace thicklens::tools
