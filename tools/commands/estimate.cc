// thicklens estimate: estimates a light field from one image and its depth map.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/memory_available.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/base/utc_time.h"
#include "thicklens/estimator/block_solver.h"
#include "thicklens/estimator/functional_solver.h"
#include "thicklens/estimator/grid_solver.h"
#include "thicklens/estimator/inpaint.h"
#include "thicklens/estimator/scene_solver.h"
#include "thicklens/io/block_checkpoint.h"
#include "thicklens/io/confidence_files.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/kernels/device.h"
#include "tools/commands/commands.h"
#include "tools/commands/estimate_run.h"
#include "tools/options/command_frame.h"
#include "tools/options/estimate_input.h"
#include "tools/options/estimate_options.h"
#include "tools/options/estimate_plan.h"
#include "tools/options/estimate_profile.h"
#include "tools/options/file_seconds.h"
#include "tools/options/plan_choice.h"
#include "tools/options/quality_target_options.h"
#include "tools/report/estimate_records.h"
#include "tools/report/estimate_summary.h"
#include "tools/report/light_field_page.h"
#include "tools/report/report_folder.h"
#include "tools/system/build_info.h"
#include "tools/system/interrupt.h"
#include "tools/system/progress_line.h"

namespace thicklens::tools {
namespace {

// Outputs are claimed before anything is computed, so that an invalid output is reported at once.
struct Outputs {
  explicit Outputs(const EstimateOptions& options)
      : light_field(options.output_folder, io::kLightFieldMarker, io::LightFieldEntries()),
        report_folder(options.report_folder) {
    if (!options.report_folder.empty()) report.emplace(options.report_path());
    if (!options.checkpoint_path.empty()) {
      checkpoint = std::make_unique<io::BlockCheckpoint>(
          options.checkpoint_path, BuildInfo(),
          [](const std::string& text) { spdlog::warn("{}", text); });
    }
  }
  // Runs at the end of every run that did not complete the light field.
  ~Outputs() {
    const std::string kept = WhatIsKept();
    if (!kept.empty()) spdlog::warn("{}", kept);
  }
  Outputs(const Outputs&) = delete;
  Outputs& operator=(const Outputs&) = delete;

  OutputFolder light_field;
  ReportFolder report_folder;
  std::optional<OutputFile> report;
  std::unique_ptr<io::BlockCheckpoint> checkpoint;  // none if it was not requested

 private:
  std::string WhatIsKept() const {
    const int kept = checkpoint ? checkpoint->kept() : 0;
    if (kept == 0) return "";
    return fmt::format(
        "{} solved block(s) are kept in {}: the same command continues from there; for other "
        "settings remove it or name another",
        kept, checkpoint->path());
  }
  const LastWords last_words_{[this] { return WhatIsKept(); }};
};

// The maximum size of a part of the image that is solved as a whole: larger parts take more
// memory and time per pixel, and the result does not improve.
constexpr double kMaxBandPixels = 3e6;

estimator::SceneOptions SceneSettings(const EstimateOptions& options,
                                      const estimator::EstimateInput& input,
                                      const model::EffectSet& on, const Progress& progress) {
  estimator::SceneOptions settings = SceneOptionsOf(options, on, progress);
  if (!settings.memory_limit_mib) settings.memory_limit_mib = UsualMemoryLimitMib();
  const auto pixels = static_cast<double>(input.disparity.disparity.size());
  settings.least_bands = std::max(1, static_cast<int>(std::ceil(pixels / kMaxBandPixels)));
  return settings;
}

void CheckBlur(const EstimateOptions& options, const estimator::EstimateInput& input,
               const model::EffectSet& on, EstimateOutcome* outcome) {
  ProgressLine line("checking the blur", options.common.quiet);
  estimator::BlurCheckOptions settings =
      BlurCheckOptionsOf(options, on, [&line](int done, int total) {
        ThrowIfCancelled();
        line.Show(done, total);
      });
  if (!settings.memory_limit_mib) settings.memory_limit_mib = UsualMemoryLimitMib();
  const auto start = Clock::now();
  outcome->blur.emplace(estimator::CheckBlur(input, settings), input, options.depth);
  outcome->seconds.blur_check = SecondsSince(start);
}

// Views are written as soon as they are computed, unless a page shows them or they are inpainted.
void SolveScene(const EstimateOptions& options, const estimator::EstimateInput& input,
                const model::EffectSet& on, const Progress& progress, io::LightFieldWriter* writer,
                EstimateOutcome* outcome) {
  // Starting a device pays off only if it is requested.
  const auto backend = kernels::OpenBackend(
      kernels::ParseDeviceRequest(options.device == "auto" ? "cpu" : options.device), nullptr,
      ThrowIfCancelled);
  spdlog::debug("device: {}", backend->description());
  const estimator::SceneOptions settings = SceneSettings(options, input, on, progress);
  if (options.check_blur) CheckBlur(options, input, on, outcome);
  estimator::SceneSummary scene;
  if (!options.report_folder.empty() || options.fill == "telea") {
    outcome->light_field =
        estimator::EstimateScene(input, settings, &scene, &outcome->maps, backend.get());
  } else {
    estimator::SceneViewSink sink;
    sink.take = [writer](int k, int l, const model::LinearImage& view,
                         const std::vector<estimator::Confidence>& confidence) {
      ThrowIfCancelled();
      writer->WriteView(k, l, view);
      writer->WriteConfidence(k, l, confidence, view.width_px);
    };
    sink.bytes = writer->BytesForView(static_cast<double>(input.image.values.size()));
    outcome->light_field =
        estimator::EstimateSceneViews(input, settings, sink, &scene, &outcome->maps, backend.get());
  }
  outcome->seconds.setup += scene.setup_seconds;
  outcome->seconds.solve = scene.solve_seconds;
  outcome->seconds.files = writer->seconds() / scene.threads;
  outcome->seconds.views = std::max(0.0, scene.views_seconds - outcome->seconds.files);
  outcome->maps.radiance = {};  // the centre view of the light field shows it
  outcome->scene = std::move(scene);
}

void SolveBlocks(const EstimateOptions& options, const estimator::EstimateInput& input,
                 const model::EffectSet& on, const Progress& progress,
                 io::BlockCheckpoint* checkpoint, EstimateOutcome* outcome) {
  std::string notice;
  // The device that auto selects may depend on the load of the machine.
  const std::string device = options.device == "auto" && checkpoint != nullptr
                                 ? checkpoint->device().value_or(options.device)
                                 : options.device;
  const auto backend =
      kernels::OpenBackend(kernels::ParseDeviceRequest(device), &notice, ThrowIfCancelled);
  if (!notice.empty()) spdlog::warn("{}", notice);
  spdlog::debug("device: {}", backend->description());
  estimator::BlockOptions settings = BlockOptionsOf(options, on, progress);
  settings.store = checkpoint;
  // The number of blocks that a memory limit allows varies a little from run to run with the other
  // memory of the process.
  constexpr double kLittle = 1.05;
  if (checkpoint != nullptr && checkpoint->block_px() && settings.memory_limit_mib &&
      !settings.block_px) {
    settings.block_px = checkpoint->block_px();
    *settings.memory_limit_mib *= kLittle;
  }
  estimator::BlockSummary blocks;
  outcome->light_field = estimator::EstimateByBlocks(input, settings, backend.get(), &blocks);
  outcome->seconds.setup += blocks.setup_seconds;
  outcome->seconds.solve = blocks.solve_seconds;
  outcome->blocks = std::move(blocks);
}

void SolveFunctional(const EstimateOptions& options, const estimator::EstimateInput& input,
                     const model::EffectSet& on, const Progress& progress,
                     EstimateOutcome* outcome) {
  spdlog::debug("device: cpu");
  const auto estimate =
      options.solver == "grid" ? estimator::EstimateOnGrid : estimator::EstimateFunctional;
  estimator::FunctionalSummary functional;
  outcome->light_field = estimate(input, FunctionalOptionsOf(options, on, progress), &functional);
  outcome->seconds.setup += functional.setup_seconds;
  outcome->seconds.solve = functional.solve_seconds;
  outcome->seconds.views = functional.views_seconds;
  outcome->functional = std::move(functional);
}

// Chooses by the profile, scaled by the present speed of this machine if the profile was made on
// another one or for other threads. The time since `start` is spent already.
estimator::PlanChoice ChoosePlanHere(const EstimateOptions& options,
                                     const estimator::EstimateInput& input,
                                     Clock::time_point start) {
  const estimator::EstimateProfile profile = ProfileFor(options.profile_path);
  const int threads = ResolveThreads(options.common.threads);
  const double speed_ratio =
      IsFromHere(profile, threads) ? 1 : ProbeSeconds(threads) / profile.probe_seconds;
  estimator::Workload load = MeasuredWorkload(input);
  spdlog::debug("plan: blur of {:.3g} px (sigma, rms), {:.3g} s for the files on one thread",
                load.blur_sigma_px, load.file_seconds);
  // The model of the time knows how the profile's threads share the files.
  load.file_seconds *= static_cast<double>(profile.threads) / threads;
  estimator::PlanChoice choice = estimator::ChoosePlan(profile, options.quality_target,
                                                       QualityTargetText(options.quality_target),
                                                       load, speed_ratio, SecondsSince(start));
  // Options whose time the model does not include.
  std::vector<std::string> besides;
  if (!options.report_folder.empty()) besides.emplace_back("--report");
  if (options.fill == "telea") besides.emplace_back("--fill telea");
  if (options.memory_limit_mib) besides.emplace_back("--memory-limit");
  if (options.format == "tiff") besides.emplace_back("--format tiff");
  if (!besides.empty()) {
    choice.message += fmt::format("; without the time for {}", fmt::join(besides, ", "));
  }
  return choice;
}

// Throws Error for settings that are not valid.
void CheckSettings(const EstimateOptions& options) {
  if (options.solver == "scene") {
    SceneOptionsOf(options, {}, {});
  } else if (options.by_blocks()) {
    BlockOptionsOf(options, {}, {});
  } else {
    FunctionalOptionsOf(options, {}, {});
  }
}

void Solve(const EstimateOptions& options, const PreparedEstimate& prepared,
           const Progress& progress, io::LightFieldWriter* writer, io::BlockCheckpoint* checkpoint,
           EstimateOutcome* outcome) {
  const estimator::EstimateInput& input = prepared.input;
  const model::EffectSet& on = prepared.effects.on;
  if (options.solver == "scene") return SolveScene(options, input, on, progress, writer, outcome);
  if (options.by_blocks()) return SolveBlocks(options, input, on, progress, checkpoint, outcome);
  SolveFunctional(options, input, on, progress, outcome);
}

void Inpaint(const EstimateOptions& options, const estimator::EstimateInput& input,
             EstimateOutcome* outcome) {
  ProgressLine line("inpainting", options.common.quiet);
  estimator::InpaintOptions settings;
  settings.threads = options.common.threads;
  settings.progress = [&line](int done, int total) {
    ThrowIfCancelled();
    line.Show(done, total);
  };
  outcome->inpainting.emplace();
  estimator::InpaintOccludedRays(input.disparity, settings, &outcome->light_field,
                                 &*outcome->inpainting);
  outcome->light_field.origin.method += "+telea";
  outcome->seconds.views += outcome->inpainting->seconds;
}

// Writes the outputs that were not written while they were computed.
void WriteRays(const EstimateOptions& options, const estimator::EstimateInput& input,
               const EstimateOutcome& outcome, io::LightFieldWriter* writer) {
  const model::LightField& light_field = outcome.light_field;
  if (light_field.values.empty()) return;
  io::WriteViews(light_field, writer);
  if (outcome.scene) {
    io::WriteConfidence(outcome.maps.confidence, light_field.u_count, light_field.s_count,
                        light_field.t_count, writer);
  } else {
    io::WriteConfidence(input, options.common.threads, writer);
  }
}

// Returns the photograph's disparity in px per view step, as the page shows it.
PageDepth DepthForPage(const PreparedEstimate& prepared) {
  const estimator::DisparityMap& map = prepared.input.disparity;
  const bool along_u = map.step.x() != 0;
  PageDepth depth{map.width_px, map.height_px, map.disparity, false};
  const double step = along_u ? map.step.x() : map.step.y();
  for (std::size_t i = 0; i < depth.values.size(); ++i) {
    depth.values[i] = prepared.depth.was_hole[i]
                          ? std::numeric_limits<float>::quiet_NaN()
                          : static_cast<float>(static_cast<double>(depth.values[i]) * step);
  }
  if (along_u) depth.v_per_u = map.step.y() / map.step.x();
  return depth;
}

// Returns for the page what was read, and what was assumed.
std::vector<std::pair<std::string, std::string>> SourcesOf(const EstimateOptions& options,
                                                           const std::string& aperture,
                                                           const nlohmann::json& summary) {
  const DepthOptions& depth = options.depth;
  std::string how = depth.kind;
  if (!depth.unit.empty()) how += ", " + depth.unit;
  if (depth.disparity_scale != 1 || depth.disparity_offset_px != 0) {
    how +=
        fmt::format(", {:g} times the map {} {:g} px", depth.disparity_scale,
                    depth.disparity_offset_px < 0 ? "-" : "+", std::abs(depth.disparity_offset_px));
  }
  const std::string from = summary["transfer_from"];
  const std::string said = from == "option" ? "--transfer" : from == "camera" ? "the camera" : "";
  return {{"photograph", options.image_path},
          {"depth map", fmt::format("{} ({})", options.depth_path, how)},
          {"camera", options.camera_path},
          {"part of both", options.crop.text},
          {"encoded values", fmt::format("{} ({})", summary["transfer"].get<std::string>(),
                                         said.empty() ? "assumed" : "from " + said)},
          {"aperture", aperture}};
}

std::string Page(const EstimateOptions& options, PreparedEstimate prepared,
                 const EstimateOutcome& outcome, const nlohmann::json& summary,
                 std::vector<std::string> warnings) {
  LightFieldPageInput page;
  page.name = options.output_folder;
  page.light_field = &outcome.light_field;
  page.depth = DepthForPage(prepared);
  page.photo = std::move(prepared.input.image);
  page.estimate =
      ParseEstimateRecord(summary.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace),
                          options.common.json_path);
  if (outcome.scene) page.maps = &outcome.maps;
  page.warnings = std::move(warnings);
  page.sources = SourcesOf(options, prepared.aperture.InWords(), summary);
  page.mosaic = true;
  page.version = Version();
  page.date = outcome.light_field.origin.date;
  page.threads = options.common.threads;
  return MakeLightFieldPage(page).html;
}

}  // namespace

CommandResult RunEstimate(const EstimateOptions& given) {
  const auto start = Clock::now();
  EstimateOptions options = given;
  CheckSettings(options);  // before anything is read
  if (options.memory_limit_mib) ReturnMemoryAtOnce();
  Outputs outputs(options);
  ProgressLine line("estimating", options.common.quiet);
  const Progress progress = [&line](int done, int total) {
    ThrowIfCancelled();
    line.Show(done, total);
  };
  PreparedEstimate prepared = PrepareEstimate(options);
  ThrowIfCancelled();
  std::optional<estimator::PlanChoice> choice;
  if (options.quality_target.has_value()) {
    choice = ChoosePlanHere(options, prepared.input, start);
    spdlog::info("{}", PrintableUtf8(choice->message));
    ApplyPlan(choice->plan, &options);
    CheckSolverUsage(options);
    CheckSettings(options);
  }

  EstimateOutcome outcome;
  outcome.seconds.read = outcome.seconds.setup = SecondsSince(start);
  io::LightFieldWriter writer(
      prepared.input.transfer,
      options.format == "tiff" ? io::ViewFormat::kTiff : io::ViewFormat::kPng,
      &outputs.light_field);
  Solve(options, prepared, progress, &writer, outputs.checkpoint.get(), &outcome);
  if (options.fill == "telea") Inpaint(options, prepared.input, &outcome);
  model::LightFieldOrigin& origin = outcome.light_field.origin;
  origin.seconds = outcome.seconds.setup + outcome.seconds.solve + outcome.seconds.views;
  origin.effects = prepared.effects.on.Names();
  origin.version = Version();
  origin.date = NowIso8601();
  CheckOutcome(prepared, &outcome);
  ThrowIfCancelled();

  const auto files_start = Clock::now();
  WriteRays(options, prepared.input, outcome, &writer);
  const std::size_t clipped = writer.Finish(outcome.light_field);
  outcome.clipped_fraction =
      static_cast<double>(clipped) /
      static_cast<double>(outcome.light_field.ViewStart(outcome.light_field.channels, 0, 0));
  outcome.confidence = estimator::SharesOf(writer.confidence_counts());
  outcome.seconds.files += SecondsSince(files_start);
  outcome.seconds.total = SecondsSince(start);

  CommandResult result;
  result.summary = EstimateJson(options, prepared, outcome);
  std::string text = EstimateText(prepared, outcome, result.summary);
  result.summary["plan"] = nullptr;
  if (choice) {
    result.summary["plan"] = ChoiceJson(*choice, options.quality_target, outcome.seconds.total);
    text += ChoiceText(*choice, outcome.seconds.total);
  }
  const std::vector<std::string> warnings = EstimateWarnings(options, prepared, outcome);
  std::string page;
  if (outputs.report) page = Page(options, std::move(prepared), outcome, result.summary, warnings);
  ThrowIfCancelled();
  outputs.light_field.Commit();
  result.is_written = true;
  if (outputs.report) outputs.report->Commit(page);
  if (outputs.checkpoint && !outputs.checkpoint->Remove()) {
    spdlog::warn("{}: is no longer needed, but could not be removed", outputs.checkpoint->path());
  }
  for (const std::string& warning : warnings) spdlog::warn("{}", warning);
  PrintResult(options.common, text);
  return result;
}

void AddEstimateCommand(CLI::App* program, CommandAction* action) {
  CLI::App* command = program->add_subcommand(
      "estimate", "Estimate the light field of one image with its depth map");
  const auto options = std::make_shared<EstimateOptions>();
  AddEstimateOptions(command, options.get());
  command->callback([options, action] {
    *action = [options] {
      CheckEstimateUsage(*options);
      RequireDistinctFiles({options->common.json_path, options->output_folder,
                            options->report_path(), options->checkpoint_path},
                           {options->image_path, options->depth_path, options->camera_path,
                            options->aperture_of, options->profile_path});
      RunCommand(options->common, [&] { return RunEstimate(*options); });
    };
  });
}

}  // namespace thicklens::tools
