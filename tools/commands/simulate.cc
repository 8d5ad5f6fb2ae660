// thicklens simulate: simulates photographs on the bench, with their true values.
#include "thicklens/simulate.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "thicklens/base/cancel.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/stopwatch.h"
#include "tools/commands/commands.h"
#include "tools/commands/simulate_scene.h"
#include "tools/options/command_frame.h"
#include "tools/options/deprecated_names.h"
#include "tools/options/effect_options.h"
#include "tools/options/interface_options.h"
#include "tools/report/ablation_page.h"
#include "tools/report/ablation_run.h"
#include "tools/system/progress_line.h"

namespace thicklens::tools {
namespace {

struct SimulateOptions {
  CommonOptions common;
  std::string config_path;
  std::string output_folder;
  std::optional<std::int64_t> seed;
  bool unknown_offset = false;
  bool ablate = false;
  EffectOptions effects{{}, {}, {}, false};  // auto has nothing to choose
};

nlohmann::json Summary(const SimulateOptions& options, const SweepSimulation& simulation,
                       const model::SweepTruth& truth, double seconds) {
  const auto [near, far] =
      std::minmax_element(truth.frames.begin(), truth.frames.end(),
                          [](const auto& a, const auto& b) { return a.depth_mm < b.depth_mm; });
  return {{"status", "ok"},
          {"reason", ""},
          {"output", options.output_folder},
          {"frames", truth.frames.size()},
          {"width_px", simulation.camera.sensor.width_px},
          {"height_px", simulation.camera.sensor.height_px},
          {"target", model::TargetKindName(simulation.target.kind)},
          {"seed", simulation.seed},
          {"nearest_depth_mm", near->depth_mm},
          {"farthest_depth_mm", far->depth_mm},
          {"truth",
           {{"image_distance_mm", truth.image_distance_mm},
            {"focus_depth_mm", truth.focus_depth_mm},
            {"blur_ratio", truth.blur_ratio},
            {"blur_floor_px", truth.blur_floor_px},
            {"bench_offset_mm", truth.bench_offset_mm}}},
          {"seconds", seconds}};
}

// Writes the frames as they are rendered. Its progress line ends with it.
SimulatedSweep RenderSweep(const SimulateOptions& options, const SweepSimulation& simulation,
                           OutputFolder* folder) {
  const CommandRun run(options.common, {});
  return thicklens::SimulateSweep(simulation, folder, options.unknown_offset, run.control());
}

CommandResult SimulateSweep(const SimulateOptions& options) {
  const auto start = Clock::now();
  SweepSimulation simulation = ReadSweepSimulation(options.config_path);
  ReportDeprecated(options.common, simulation.notices);
  if (options.seed) simulation.seed = static_cast<std::uint64_t>(*options.seed);
  CheckEffectNames(options.effects, model::SweepEffects());
  ApplyEffectOptions(options.effects, &simulation.effects);
  OutputFolder folder = ClaimSweepFolder(options.output_folder);
  const SimulatedSweep sweep = RenderSweep(options, simulation, &folder);
  Ablation ablation;
  if (options.ablate) {
    ProgressLine progress("ablating", options.common.quiet);
    ablation.sweep = AblateSweepOf(options.config_path, simulation, options.unknown_offset,
                                   AblationRunWith(options.common, &progress));
    WriteAblation(ablation, options.config_path, &folder);
  }
  ThrowIfCancelled();
  folder.Commit();

  const std::chrono::duration<double> seconds = Clock::now() - start;
  CommandResult result;
  result.is_written = true;
  result.summary = Summary(options, simulation, sweep.truth, seconds.count());
  result.summary["bits"] = sweep.bits;
  result.summary["effects"] = EffectsJson(sweep.effects);
  PrintResult(options.common,
              fmt::format("{} frames of {} x {} px in {:.1f} s: {}\n", simulation.frame_count,
                          simulation.camera.sensor.width_px, simulation.camera.sensor.height_px,
                          seconds.count(), options.output_folder) +
                  EffectsText(sweep.effects) + (options.ablate ? AblationText(ablation) : ""));
  if (options.ablate) result.summary["ablation"] = AblationJson(ablation);
  return result;
}

}  // namespace

void AddSimulateCommand(CLI::App* program, CommandAction* action) {
  CLI::App* simulate =
      program->add_subcommand("simulate", "Simulate photographs, with their true values");
  simulate->require_subcommand(1);
  CLI::App* command = simulate->add_subcommand(
      "sweep",
      "A focus sweep: frames/, camera.yaml (without calibration), sweep.yaml and truth.yaml");
  const auto options = std::make_shared<SimulateOptions>();
  command->add_option("config", options->config_path, "Description of the sweep to simulate")
      ->required()
      ->type_name("CONFIG");
  command->add_option("-o,--output", options->output_folder, "Folder to write")
      ->required()
      ->type_name("DIR");
  command->add_option("--seed", options->seed, "Seed; overrides the one in the config")
      ->check(CLI::Range(std::int64_t{0}, std::numeric_limits<std::int64_t>::max()))
      ->type_name("N");
  command->add_flag(
      "--unknown-offset", options->unknown_offset,
      "Leave the bench offset out of sweep.yaml, so that a calibration has to find it");
  AddEffectOptions(command, &options->effects);
  command->add_flag("--ablate", options->ablate,
                    "Also simulate and calibrate without each effect in turn, and report what each "
                    "effect changes: a table, attribution.csv and the page attribution.html");
  AddDeprecatedFlags(command, "--ablate", &options->ablate, &options->common);
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      RequireDistinctFiles({options->common.json_path, options->output_folder},
                           {options->config_path});
      RunCommand(options->common, [&] { return SimulateSweep(*options); });
    };
  });
  AddSimulateSceneCommands(simulate, action);
}

}  // namespace thicklens::tools
