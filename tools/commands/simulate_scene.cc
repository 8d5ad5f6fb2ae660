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
#include "thicklens/depth.h"
#include "thicklens/image.h"
#include "thicklens/light_field.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/simulate.h"
#include "tools/options/deprecated_names.h"
#include "tools/options/effect_options.h"
#include "tools/options/interface_options.h"
#include "tools/options/light_field_options.h"
#include "tools/options/option_values.h"
#include "tools/report/ablation_page.h"
#include "tools/report/ablation_run.h"
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

SceneSimulation ReadConfig(const SceneOptions& options) {
  SceneSimulation scene = ReadSceneSimulation(options.config_path);
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

nlohmann::json Summary(const SceneOptions& options, const SceneSimulation& scene,
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

std::string SamplingText(const SceneSimulation& scene, double error) {
  const double asked = scene.sampling_error_grey_levels;
  return fmt::format("largest sampling error: about {:.2g} grey levels rms{}\n", error,
                     error > asked && asked > 0
                         ? fmt::format(" with rays_per_pixel: {} ({:.2g} would need more rays)",
                                       scene.rays_per_pixel, asked)
                         : "");
}

Ablation Attribute(const SceneOptions& options, const SceneSimulation& scene) {
  Ablation ablation;
  std::optional<SweepSimulation> sweep;
  if (!options.sweep_path.empty()) {  // read before anything that takes long
    sweep = ReadSweepSimulation(options.sweep_path);
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
  ablation.scene = AblateSceneOf(scene, AblationRunWith(options.common, &progress));
  return ablation;
}

// Its progress line ends with it.
SimulatedPhotograph RenderScene(const SceneOptions& options, const SceneSimulation& scene) {
  const CommandRun run(options.common, {});
  return SimulatePhotograph(scene, run.control());
}

CommandResult SimulateImage(const SceneOptions& options) {
  const auto start = Clock::now();
  const SceneSimulation scene = ReadConfig(options);
  OutputFolder folder(
      options.output_folder, kImageMarker,
      {"picture.png", "depth.pfm", "camera.yaml", kImageMarker, kAblationPage, kAblationTable});

  SimulatedPhotograph simulated = RenderScene(options, scene);
  const int bits = simulated.photo.bits();
  ImageFileOptions file;
  file.description =
      fmt::format("simulated; effects: {}", model::JoinedNames(simulated.effects.on));
  folder.Write("picture.png", EncodeImage(simulated.photo, file).bytes);
  folder.Write("depth.pfm", EncodeDepth(simulated.depth));
  folder.Write("camera.yaml", model::CameraToYaml(model::WithoutMeasuredPsf(simulated.camera)));
  folder.Write(kImageMarker, model::SceneTruthToYaml(simulated.truth));
  simulated.photo = Image();  // an ablation needs memory
  simulated.depth = DepthMap();
  Ablation ablation;
  if (options.ablate) {
    ablation = Attribute(options, scene);
    WriteAblation(ablation, options.config_path, &folder);
  }
  ThrowIfCancelled();
  folder.Commit();

  const model::SceneTruth& truth = simulated.truth;
  CommandResult result;
  result.is_written = true;
  result.summary = Summary(options, scene, truth, start);
  result.summary["bits"] = bits;
  result.summary["effects"] = EffectsJson(simulated.effects);
  result.summary["sampling_error_grey_levels"] = simulated.sampling_error_grey_levels;
  result.summary["rays_per_pixel"] = scene.rays_per_pixel;
  result.summary["mean_rays_per_pixel"] = simulated.mean_rays_per_pixel;
  PrintResult(
      options.common,
      fmt::format("an image of {} x {} px, depths from {:.6g} to {:.6g} mm, blur sigma up "
                  "to {:.3g} px, in {:.1f} s: {}\n",
                  scene.camera.sensor.width_px, scene.camera.sensor.height_px,
                  truth.nearest_depth_mm, truth.farthest_depth_mm, truth.largest_blur_sigma_px,
                  result.summary["seconds"].get<double>(), options.output_folder) +
          EffectsText(simulated.effects) +
          SamplingText(scene, simulated.sampling_error_grey_levels) +
          (options.ablate ? AblationText(ablation) : ""));
  if (options.ablate) result.summary["ablation"] = AblationJson(ablation);
  return result;
}

// Writes the views below the folder, and returns the number of clipped values. Its progress line
// ends with it.
std::size_t RenderViews(const SceneOptions& options, const SceneSimulation& scene,
                        LightFieldFormat format, OutputFolder* folder, SimulatedScene* simulated) {
  const CommandRun run(options.common, {});
  const LightField light_field = thicklens::SimulateLightField(scene, run.control(), simulated);
  return WriteLightField(folder, light_field, format, run.control());
}

CommandResult SimulateLightField(const SceneOptions& options) {
  const auto start = Clock::now();
  const SceneSimulation scene = ReadConfig(options);
  const LightFieldFormat format =
      options.format == "tiff" ? LightFieldFormat::kTiff : LightFieldFormat::kPng;
  OutputFolder folder = ClaimLightFieldFolder(options.output_folder, format);

  SimulatedScene simulated;
  const std::size_t clipped = RenderViews(options, scene, format, &folder, &simulated);
  ThrowIfCancelled();
  folder.Commit();

  CommandResult result;
  result.is_written = true;
  result.summary = Summary(options, scene, simulated.truth, start);
  result.summary["views"] = {scene.u_count, scene.v_count};
  result.summary["clipped_values"] = clipped;
  result.summary["effects_of_views"] = simulated.effects_of_views.Names();
  PrintResult(
      options.common,
      fmt::format("{} x {} views of {} x {} px in {:.1f} s: {}\n", scene.u_count, scene.v_count,
                  scene.camera.sensor.width_px, scene.camera.sensor.height_px,
                  result.summary["seconds"].get<double>(), options.output_folder) +
          fmt::format("effects of the views: {}\n",
                      model::JoinedNames(simulated.effects_of_views)));
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
  AddFormerEffectTolerance(command, &options->effects, &options->common);
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
