// thicklens estimate: estimates a light field from one image and its depth map.
#include "thicklens/estimate.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/index.h"
#include "thicklens/base/memory_available.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/parallel.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/base/stopwatch.h"
#include "thicklens/io/block_checkpoint.h"
#include "thicklens/io/confidence_files.h"
#include "thicklens/io/light_field_io.h"
#include "tools/commands/commands.h"
#include "tools/commands/estimate_run.h"
#include "tools/options/command_frame.h"
#include "tools/options/distortion_option.h"
#include "tools/options/estimate_call.h"
#include "tools/options/estimate_options.h"
#include "tools/options/estimate_plan.h"
#include "tools/options/estimate_profile.h"
#include "tools/options/file_seconds.h"
#include "tools/options/interface_options.h"
#include "tools/options/plan_choice.h"
#include "tools/options/quality_target_options.h"
#include "tools/report/estimate_records.h"
#include "tools/report/estimate_summary.h"
#include "tools/report/light_field_page.h"
#include "tools/report/page_style.h"
#include "tools/report/report_folder.h"
#include "tools/system/build_info.h"
#include "tools/system/interrupt.h"

namespace thicklens::tools {
namespace {

// Outputs are claimed before anything is computed, so that an invalid output is reported at once.
struct Outputs {
  explicit Outputs(const EstimateOptions& options)
      : light_field(options.output_folder, io::kLightFieldMarker, io::LightFieldEntries()),
        report_folder(options.report_folder) {
    if (!options.report_folder.empty()) {
      RequireOwnPage(options.report_path(), kLightFieldPage);
      report.emplace(options.report_path());
    }
    if (!options.checkpoint_path.empty()) {
      checkpoint = std::make_shared<io::BlockCheckpoint>(
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
  std::shared_ptr<io::BlockCheckpoint> checkpoint;  // none if it was not requested

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

// The views' files, written as the views are made.
class FileSink final : public ViewSink {
 public:
  explicit FileSink(io::LightFieldWriter* writer) : writer_(writer) {}
  void TakeView(int k, int l, const model::LinearImage& view) override {
    writer_->WriteView(k, l, view);
  }
  void TakeConfidence(int k, int l, const std::vector<std::uint8_t>& confidence,
                      int width_px) override {
    writer_->WriteConfidence(k, l, confidence, width_px);
  }
  double BytesForView(double values) const override { return writer_->BytesForView(values); }

 private:
  io::LightFieldWriter* writer_;
};

// A run with a checkpoint continues as the run began that left blocks in it.
void ContinueFrom(const std::shared_ptr<io::BlockCheckpoint>& checkpoint,
                  thicklens::EstimateOptions* settings) {
  if (checkpoint == nullptr) return;
  auto& blocks = std::get<BlockSolver>(settings->solver);
  blocks.store = checkpoint;
  // The device that auto selects may depend on the load of the machine.
  if (settings->device == "auto") settings->device = checkpoint->device().value_or("auto");
  // The number of blocks that a memory limit allows varies a little from run to run with the other
  // memory of the process.
  constexpr double kLittle = 1.05;
  if (checkpoint->block_px() && settings->memory_limit_mib && !blocks.block_px) {
    blocks.block_px = checkpoint->block_px();
    *settings->memory_limit_mib *= kLittle;
  }
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

// Lets the interface ask for the plan once the problem is known. `choice` gets it.
SolverChooser ChooserOf(const EstimateOptions& options, Clock::time_point start,
                        std::optional<estimator::PlanChoice>* choice) {
  return [&options, start, choice](const Problem& problem, double /*seconds*/) {
    *choice = ChoosePlanHere(options, problem.input(), start);
    spdlog::info("{}", PrintableUtf8((*choice)->message));
    EstimateOptions planned = options;
    ApplyPlan((*choice)->plan, &planned);
    CheckSolverUsage(planned);
    return SolverOf((*choice)->plan);
  };
}

// Returns the photograph's disparity in px per view step, as the page shows it.
PageDepth DepthForPage(const LightFieldEstimate& estimate) {
  const Problem& problem = *estimate.problem;
  const Eigen::Vector2d step_px = problem.disparity_step();
  const bool along_u = step_px.x() != 0;
  PageDepth depth{problem.width_px(), problem.height_px(), problem.disparity(), false};
  const double step = along_u ? step_px.x() : step_px.y();
  for (std::size_t i = 0; i < depth.values.size(); ++i) {
    depth.values[i] = estimate.was_hole[i]
                          ? std::numeric_limits<float>::quiet_NaN()
                          : static_cast<float>(static_cast<double>(depth.values[i]) * step);
  }
  if (along_u) depth.v_per_u = step_px.y() / step_px.x();
  return depth;
}

// Returns for the page what was read, and what was assumed.
std::vector<std::pair<std::string, std::string>> SourcesOf(const EstimateOptions& options,
                                                           const EstimateOutcome& outcome,
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
  const std::string said = from == "option"   ? "--transfer"
                           : from == "camera" ? "the camera"
                           : from == "file"   ? "the file"
                                              : "";
  return {
      {"photograph", options.image_path},
      {"depth map", options.depth_path.empty() ? outcome.embedded_depth
                                               : fmt::format("{} ({})", options.depth_path, how)},
      {"camera", options.camera_path},
      {"part of both", options.crop.text},
      {"encoded values", fmt::format("{} ({})", summary["transfer"].get<std::string>(),
                                     said.empty() ? "assumed" : "from " + said)},
      {"aperture", ApertureInWords(options, outcome.estimate.diagnostics)},
      {"blur of the photograph", BlurShownInWords(outcome.estimate.diagnostics)}};
}

std::string Page(const EstimateOptions& options, const EstimateOutcome& outcome,
                 const nlohmann::json& summary) {
  const LightFieldEstimate& estimate = outcome.estimate;
  LightFieldPageInput page;
  page.name = options.output_folder;
  page.light_field = &estimate.light_field;
  page.depth = DepthForPage(estimate);
  page.photo = &estimate.problem->photograph();
  page.estimate =
      ParseEstimateRecord(summary.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace),
                          options.common.json_path);
  if (estimate.maps) page.maps = &*estimate.maps;
  page.warnings = estimate.summary.warnings;
  page.sources = SourcesOf(options, outcome, summary);
  page.mosaic = true;
  page.version = Version();
  page.date = estimate.light_field.origin.date;
  page.threads = options.common.threads;
  return MakeLightFieldPage(page).html;
}

// Writes an estimate that is kept as its scene. A page shows its views.
void WriteScene(bool has_page, const RunControl& run, OutputFolder* folder,
                EstimateOutcome* outcome) {
  LightFieldEstimate& estimate = outcome->estimate;
  const auto start = Clock::now();
  WriteSceneForm(folder, *estimate.scene, run);
  outcome->files_seconds = SecondsSince(start);
  if (has_page) estimate.light_field = ViewsOf(*estimate.scene, run);
}

// Estimates, and writes the light field below the staging path of its folder: views as they are
// made, unless a page shows them too.
void EstimateInto(io::LightFieldWriter* writer, OutputFolder* folder, EstimateCall call,
                  bool has_page, const RunControl& run, EstimateOutcome* outcome) {
  LightFieldEstimate& estimate = outcome->estimate;
  if (has_page) {
    estimate = EstimateLightField(std::move(call.photo), std::move(call.depth), call.camera,
                                  call.settings, run);
  } else {
    FileSink sink(writer);
    estimate = EstimateLightFieldTo(&sink, std::move(call.photo), std::move(call.depth),
                                    call.camera, call.settings, run);
    outcome->files_seconds = estimate.summary.seconds.sink;
  }
  ThrowIfCancelled();
  if (auto& seconds = estimate.light_field.origin.seconds) *seconds += outcome->read_seconds;
  if (estimate.scene) {
    estimate.scene->frame.origin.seconds = estimate.light_field.origin.seconds;
    return WriteScene(has_page, run, folder, outcome);
  }
  const auto start = Clock::now();
  const LightField& light_field = estimate.light_field;
  if (has_page) {
    io::WriteViews(light_field, writer);
    io::WriteConfidence(estimate.confidence, light_field.u_count, light_field.s_count,
                        light_field.t_count, writer);
  }
  const std::size_t clipped = writer->Finish(light_field);
  outcome->files_seconds += SecondsSince(start);
  outcome->clipped_fraction =
      static_cast<double>(clipped) /
      static_cast<double>(light_field.ViewStart(light_field.channels, 0, 0));
}

// Returns whether what is estimated of the photograph may show clipped values. They are those of
// the whole photograph: a part shows less of what is a limit.
bool MayShowClipping(const EstimateCall& call) {
  const Image& photo = call.photo;
  const PhotoClipping clipping = FindClipping(photo);
  if (!(clipping.share > 0)) return false;
  const std::optional<PixelRect>& crop = call.settings.crop;
  const bool is_moved = call.settings.undistort && call.camera && call.camera->distortion;
  // A photograph that does not contain the crop was cut before, or is refused later.
  if (!crop || is_moved || crop->x < 0 || crop->y < 0 || crop->width > photo.width_px() - crop->x ||
      crop->height > photo.height_px() - crop->y)
    return true;
  const auto value_at = [&photo](std::size_t i) {
    return photo.is_linear() ? static_cast<double>(photo.light().values[i])
                             : photo.encoded().values[i] / photo.encoded().full_scale();
  };
  const auto channels = Index(photo.channels());
  for (int y = crop->y; y < crop->y + crop->height; ++y) {
    ThrowIfCancelled();
    for (int x = crop->x; x < crop->x + crop->width; ++x) {
      const std::size_t pixel = Index(y) * Index(photo.width_px()) + Index(x);
      for (std::size_t c = 0; c < clipping.levels.size(); ++c) {
        const double level = clipping.levels[c];
        if (level > 0 && value_at(pixel * channels + c) >= level) return true;
      }
    }
  }
  return false;
}

// Highlights that are estimated are brighter than full scale, where png ends.
io::ViewFormat FormatFor(const EstimateOptions& options, const EstimateCall& call) {
  const bool is_auto_tiff = options.format == "auto" && options.solver == "scene" &&
                            options.clipped == "bounds" && MayShowClipping(call);
  return is_auto_tiff || options.format == "tiff" ? io::ViewFormat::kTiff : io::ViewFormat::kPng;
}

}  // namespace

CommandResult RunEstimate(const EstimateOptions& options) {
  const auto start = Clock::now();
  SettingsOf(options);  // before anything is read
  if (options.memory_limit_mib) ReturnMemoryAtOnce();
  Outputs outputs(options);
  EstimateOutcome outcome;
  std::optional<estimator::PlanChoice> choice;
  WithOptionNames(EstimateOptionNames(), [&] {
    const CommandRun run(options.common, EstimateOptionNames());  // its progress line ends with it
    EstimateCall call = ReadEstimateCall(options, run.control());
    outcome.photo_facts = call.photo.facts();
    if (options.depth_path.empty()) outcome.embedded_depth = call.depth.notes.front();
    ThrowIfCancelled();
    ContinueFrom(outputs.checkpoint, &call.settings);
    if (options.quality_target.has_value()) {
      call.settings.solver = ChooserOf(options, start, &choice);
    }
    outcome.read_seconds = SecondsSince(start);
    io::LightFieldWriter writer(TransferOf(call), FormatFor(options, call), &outputs.light_field,
                                call.photo.ColourProfile(TransferOf(call)));
    EstimateInto(&writer, &outputs.light_field, std::move(call), outputs.report.has_value(),
                 run.control(), &outcome);
  });
  outcome.total_seconds = SecondsSince(start);

  CommandResult result;
  result.summary = EstimateJson(options, outcome);
  std::string text = EstimateText(options, outcome, result.summary);
  result.summary["plan"] = nullptr;
  if (choice) {
    result.summary["plan"] = ChoiceJson(*choice, options.quality_target, outcome.total_seconds);
    text += ChoiceText(*choice, outcome.total_seconds);
  }
  std::string page;
  if (outputs.report) page = Page(options, outcome, result.summary);
  ThrowIfCancelled();
  outputs.light_field.Commit();
  result.is_written = true;
  if (outputs.report) outputs.report->Commit(page);
  if (outputs.checkpoint && !outputs.checkpoint->Remove()) {
    spdlog::warn("{}: is no longer needed, but could not be removed", outputs.checkpoint->path());
  }
  PrintResult(options.common, text + WrittenText({options.output_folder, options.report_path()}));
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
      std::vector<std::string> inputs = {options->image_path,
                                         options->depth_path,
                                         options->camera_path,
                                         options->aperture_of,
                                         options->profile_path,
                                         FileOfDistortion(options->distortion),
                                         options->depth_fit.camera_path,
                                         options->depth_fit.confidence_path};
      const model::CorrectionFiles& correction = options->correction;
      for (const auto* more : {&correction.dark, &correction.flat, &correction.defects})
        inputs.insert(inputs.end(), more->begin(), more->end());
      RequireDistinctFiles({options->common.json_path, options->output_folder,
                            options->report_path(), options->checkpoint_path},
                           inputs);
      RunCommand(options->common, [&] { return RunEstimate(*options); });
    };
  });
}

}  // namespace thicklens::tools
