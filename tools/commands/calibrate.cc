// thicklens calibrate: from a focus sweep to a camera with its image distance and blur.
#include "thicklens/calibrate.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/base/utc_time.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/io/files_read.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/opencv.h"
#include "thicklens/sweep.h"
#include "tools/commands/calibrate_watch.h"
#include "tools/commands/commands.h"
#include "tools/commands/sweep_outputs.h"
#include "tools/options/circle_option.h"
#include "tools/options/command_frame.h"
#include "tools/options/deprecated_names.h"
#include "tools/options/interface_options.h"
#include "tools/options/option_values.h"
#include "tools/options/sweep_input.h"
#include "tools/options/sweep_options.h"
#include "tools/report/calibration_json.h"
#include "tools/report/calibration_report.h"
#include "tools/report/calibration_summary.h"
#include "tools/report/distortion_words.h"
#include "tools/report/files_read_json.h"
#include "tools/report/input_summary.h"
#include "tools/report/page_style.h"
#include "tools/report/report_folder.h"
#include "tools/report/sweep_imaging.h"
#include "tools/system/build_info.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

struct CalibrateOptions {
  CommonOptions common;
  SweepArguments sweep;
  std::string camera_output;  // empty: no camera file
  std::string report_folder;  // empty: no report
  std::string method = "fit";
  bool no_field = false;
  bool dry_run = false;
  bool watch = false;
  std::optional<double> watch_pause_s;
  CircleOption circle;
  SweepOutputPaths more;  // images and the PSF

  bool by_paper() const { return method == "paper"; }
  std::string report_path() const {
    return report_folder.empty() ? "" : (fs::path(report_folder) / "index.html").string();
  }
  std::string figures_path() const {
    return report_folder.empty() ? "" : (fs::path(report_folder) / "figures").string();
  }
};

// A folder with this file was written by this program.
constexpr char kCaptions[] = "captions.txt";
// The former name of the page. Such a file is not removed: it may be anyone's.
constexpr char kFormerReport[] = "report.html";

std::vector<std::string> OwnFigureFiles() {
  std::vector<std::string> names = ReportFigureNames();
  names.emplace_back(kCaptions);
  return names;
}

// Outputs are claimed before anything is measured, so that an invalid output is reported at once.
struct Outputs {
  explicit Outputs(const CalibrateOptions& options) : folder(options.report_folder) {
    if (!options.camera_output.empty()) camera.emplace(options.camera_output);
    more = ClaimSweepOutputs(options.more);
    if (options.report_folder.empty()) return;
    RequireOwnPage(options.report_path(), kCalibrationPage);
    report.emplace(options.report_path());
    figures.emplace(options.figures_path(), kCaptions, OwnFigureFiles());
  }

  ReportFolder folder;
  std::optional<OutputFile> camera;
  SweepOutputFiles more;
  std::optional<OutputFile> report;
  std::optional<OutputFolder> figures;
};

const model::SweepTruth* TruthOf(const Sweep& sweep) {
  return sweep.truth ? &*sweep.truth : nullptr;
}

// Its progress line ends with it.
Calibration Measure(const CalibrateOptions& options, const Sweep& sweep) {
  const CommandRun run(options.common, SweepOptionNames());
  thicklens::CalibrateOptions asked;
  asked.method = options.by_paper() ? CalibrationMethod::kPaper : CalibrationMethod::kFit;
  asked.map_field = !options.no_field;
  asked.on_refusal = OnRefusal::kReturn;
  return thicklens::Calibrate(sweep, asked, run.control());
}

// Refuses before the measurement what would fail after it.
void RequirePossible(const CalibrateOptions& options, const Sweep& sweep) {
  RequireFramesOfOutputs(options.more, sweep.description.raw);
  RequirePossibleCircle(options.circle, sweep.camera);
}

// The MTF of the frames. The frames of a sweep that was measured on the green sites of raw files
// are others, with interpolated edges: their MTF is computed from the fit.
calib::SweepTransfer Transfer(const calib::FocusSweep& focus_sweep, model::SweepRaw raw,
                              const calib::Calibration& calibration, int threads) {
  if (raw != model::SweepRaw::kGreen)
    return calib::MeasureSweepTransfer(focus_sweep, calibration, threads);
  calib::FocusSweep without_edges = focus_sweep;
  without_edges.target = model::SweepTarget::kTexture;
  calib::Calibration fitted = calibration;
  fitted.diagnostics.blur.estimator.clear();
  calib::SweepTransfer transfer = calib::MeasureSweepTransfer(without_edges, fitted, threads);
  transfer.message = transfer.done ? "modelled: with raw: green, no edge is measured"
                                   : "with raw: green, no edge is measured, and no blur was fitted";
  return transfer;
}

// Measures the MTF and makes the images and the PSF that were asked for. The camera of the
// calibration gets the measured PSF.
SweepImaging Imaging(const CalibrateOptions& options, const calib::FocusSweep& focus_sweep,
                     model::SweepRaw raw, Calibration* calibration, SweepOutputBytes* bytes) {
  SweepImaging imaging;
  imaging.has_psf = !options.more.psf.empty();
  imaging.has_image = !options.more.image.empty();
  imaging.has_focus_map = !options.more.focus_map.empty();
  if (!calibration->refusal.empty()) {
    imaging.transfer.message = calibration->refusal;
    return imaging;
  }
  const Camera& camera = calibration->camera;
  imaging.units = calib::TransferUnitsOf(camera);
  const CommandRun run(options.common, SweepOptionNames());
  // The calibration is that of one part of a target with relief; images show all of it.
  calib::FocusSweep part = focus_sweep;
  const auto& region = calibration->diagnostics.target.relief.region;
  if (region) part.roi = *region;
  imaging.transfer = Transfer(part, raw, *calibration, run.control().threads);
  const double circle_mm = CircleOfConfusionMm(options.circle, camera.sensor);
  if (camera.calibration && camera.calibration->image_distance_mm &&
      camera.calibration->blur_ratio && circle_mm < 2 * camera.lens.aperture_radius_mm)
    imaging.limits = model::FocusLimitsOf(camera, circle_mm);
  MakeSweepOutputs(options.more, options.camera_output, focus_sweep, part, run.control(),
                   calibration, &imaging, bytes);
  return imaging;
}

CalibrationReport Report(const CalibrateOptions& options, const Sweep& sweep,
                         const calib::FocusSweep& focus_sweep, const Calibration& calibration,
                         const SweepImaging& imaging) {
  const auto& calibrated = calibration.camera.calibration;
  std::vector<std::string> notices = sweep.notices;
  if (sweep.description.raw == model::SweepRaw::kGreen)
    notices.emplace_back("measured on the green sites of raw files; px are those of the sensor");
  const ReportOrigin origin{options.sweep.input, Version(),
                            calibrated ? calibrated->evidence.date : NowIso8601(), notices,
                            sweep.description.reading_sigma_stated};
  return MakeCalibrationReport(focus_sweep, calibration, TruthOf(sweep), origin,
                               focus_sweep.read_frame, &imaging);
}

// All texts are made, and the figures written to temporary files, before the first file is put in
// place.
void WriteOutputs(const CalibrateOptions& options, const Sweep& sweep,
                  const calib::FocusSweep& focus_sweep, const Calibration& calibration,
                  const SweepImaging& imaging, const SweepOutputBytes& more, Outputs* outputs) {
  std::string camera;
  CalibrationReport report;
  if (outputs->camera && calibration.refusal.empty()) {
    camera = model::CameraToYaml(calibration.camera);
  }
  if (outputs->report) {
    report = Report(options, sweep, focus_sweep, calibration, imaging);
    for (const ReportFile& figure : report.figures)
      outputs->figures->Write(figure.name, figure.content);
    outputs->figures->Write(kCaptions, report.captions);
    if (imaging.transfer.done)
      outputs->figures->Write(kTransferTable, TransferCsv(imaging, calibration));
  }
  ThrowIfCancelled();
  if (outputs->report) {
    outputs->report->Commit(report.html);
    outputs->figures->Commit();
    spdlog::debug("{} written", options.report_path());
    const fs::path older = fs::path(options.report_folder) / kFormerReport;
    std::error_code ignored;
    if (fs::exists(older, ignored) && !options.common.quiet) {
      spdlog::warn("{}: this page of an older version stays; the present one is {}",
                   PrintableUtf8(older.string()), PrintableUtf8(options.report_path()));
    }
  }
  CommitSweepOutputs(more, &outputs->more);
  if (!camera.empty()) {
    outputs->camera->Commit(camera);
    spdlog::debug("{} written", options.camera_output);
  }
}

// Describes what was read from the files of the frames.
std::string FramesLines(const Sweep& sweep, const Calibration& calibration) {
  std::string lines;
  if (calibration.frames_read && !calibration.frames_read->empty())
    lines =
        fmt::format("frames     {}\n", PrintableUtf8(io::FilesReadLine(*calibration.frames_read)));
  if (sweep.description.raw == model::SweepRaw::kGreen)
    lines += "raw        measured on the green sites of each 2 x 2 px; px below are the sensor's\n";
  if (sweep.description.full_scale)
    lines += fmt::format("full scale {}\n", PrintableUtf8(sweep.full_scale_reason));
  return lines + CorrectionText(sweep);
}

// Name of the choice for raw files; null: the frames are none.
nlohmann::json RawMethod(const Sweep& sweep, const Calibration& calibration) {
  const bool has_raw =
      calibration.frames_read != nullptr &&
      std::any_of(calibration.frames_read->begin(), calibration.frames_read->end(),
                  [](const io::FilesRead& group) { return group.facts.raw.has_value(); });
  return has_raw ? nlohmann::json(model::SweepRawName(sweep.description.raw)) : nlohmann::json();
}

CommandResult RunCalibration(const CalibrateOptions& options, const Sweep& sweep) {
  Outputs outputs(options);
  Calibration calibration = Measure(options, sweep);
  calib::FocusSweep focus_sweep = FocusSweepOf(sweep);
  // Figures and images show the frames as they were measured.
  const calib::GridGeometry& grid = calibration.diagnostics.grid;
  if (grid.distortion_is_used)
    focus_sweep = calib::WithDistortion(std::move(focus_sweep), *grid.lens, focus_sweep.roi);
  SweepOutputBytes more;
  const SweepImaging imaging =
      Imaging(options, focus_sweep, sweep.description.raw, &calibration, &more);
  WriteOutputs(options, sweep, focus_sweep, calibration, imaging, more, &outputs);
  if (options.common.quiet) {  // otherwise they are part of the text
    for (const std::string& warning : calibration.summary.warnings)
      spdlog::warn("{}", PrintableUtf8(warning));
  }
  // A refusal before any measurement is one line on stderr.
  if (calibration.refusal.empty() || calibration.diagnostics.paper_recipe.done)
    PrintResult(options.common,
                FramesLines(sweep, calibration) + ReadingsLine(sweep) +
                    CalibrationText(focus_sweep, calibration, TruthOf(sweep),
                                    options.by_paper() ? "" : options.camera_output) +
                    SweepImagingText(imaging, calibration));
  if (options.by_paper() && outputs.camera && calibration.refusal.empty()) {
    PrintResult(options.common,
                fmt::format("{} has the results of the paper's method, not of the fit\n",
                            PrintableUtf8(options.camera_output)));
  }
  PrintResult(options.common,
              WrittenText({calibration.refusal.empty() ? options.camera_output : "",
                           options.report_path(), more.image.empty() ? "" : options.more.image,
                           more.focus_map.empty() ? "" : options.more.focus_map,
                           more.psf.empty() ? "" : options.more.psf}));
  CommandResult result;
  result.is_written = outputs.camera || outputs.report || !more.image.empty() ||
                      !more.focus_map.empty() || !more.psf.empty();
  result.summary = CalibrationJson(focus_sweep, calibration, TruthOf(sweep), options.by_paper());
  AddSweepImaging(imaging, calibration, &result.summary);
  result.summary["readings"] = PrintableUtf8(sweep.description.readings);
  result.summary["read"] = FilesReadJson(calibration.frames_read ? *calibration.frames_read
                                                                 : std::vector<io::FilesRead>());
  result.summary["raw"] = RawMethod(sweep, calibration);
  result.summary["correction"] = CorrectionJson(sweep);
  result.summary["distortion"] = DistortionJson(focus_sweep.camera.distortion);
  const auto& white = sweep.description.full_scale;
  result.summary["full_scale"] = {{"value", white ? nlohmann::json(*white) : nlohmann::json()},
                                  {"reason", PrintableUtf8(sweep.full_scale_reason)}};
  if (!calibration.refusal.empty()) {
    result.refusal = PrintableUtf8(fmt::format("{}: {}", options.sweep.input, calibration.refusal));
  }
  return result;
}

std::string OutputsText(const CalibrateOptions& options) {
  std::vector<std::string> outputs;
  for (const std::string& path :
       {options.camera_output, options.report_path(), options.figures_path(), options.more.image,
        options.more.focus_map, options.more.psf, options.common.json_path}) {
    if (!path.empty()) outputs.push_back(PrintableUtf8(path));
  }
  return outputs.empty() ? "nothing" : fmt::format("{}", fmt::join(outputs, ", "));
}

CommandResult RunDry(const CalibrateOptions& options, const Sweep& sweep) {
  for (const std::string& notice : NoticesOf(sweep)) spdlog::warn("{}", PrintableUtf8(notice));
  const Understanding found = Understand(sweep);
  { const Outputs could_be_written(options); }
  PrintResult(options.common,
              UnderstandingText(sweep, found, options.method, OutputsText(options)));
  // JSON has kept the former name of the paper's method.
  return {UnderstandingJson(sweep, found, options.by_paper() ? "source" : options.method), ""};
}

// Adds what the values of the frames show, unless there are too few frames. What cannot be done is
// refused first.
Sweep Examined(const CalibrateOptions& options, Sweep sweep) {
  RequirePossible(options, sweep);
  const CommandRun run(options.common, SweepOptionNames());
  std::string why;
  if (!calib::HasEnoughFrames(FocusSweepOf(sweep), &why)) return sweep;
  return WithOptionNames(run.names(),
                         [&] { return ExamineFrames(std::move(sweep), run.control()); });
}

Sweep ReadSweepOf(const CalibrateOptions& options) {
  const CommandRun run(options.common, SweepOptionNames());
  return ReadSweepInput(options.sweep, run.control());
}

// An output that cannot be written is reported before the first frame arrives.
CommandResult CalibrateWatched(const CalibrateOptions& options) {
  { const Outputs could_be_written(options); }
  WatchedSweep watched = WatchSweep(options.sweep, options.watch_pause_s, options.common);
  CommandResult result = RunCalibration(options, Examined(options, std::move(watched.sweep)));
  result.summary["watch"] = std::move(watched.summary);
  return result;
}

CommandResult Calibrate(const CalibrateOptions& options) {
  if (options.watch) return CalibrateWatched(options);
  if (options.watch_pause_s) throw UsageError("--watch-pause requires --watch");
  const Sweep sweep = Examined(options, ReadSweepOf(options));
  return options.dry_run ? RunDry(options, sweep) : RunCalibration(options, sweep);
}

void AddSweepOptions(CLI::App* command, SweepArguments* sweep) {
  command
      ->add_option(
          "sweep", sweep->input,
          "Sweep description, or a folder of frames (or a file whose pages are the frames, or a "
          "video) with --readings and --camera")
      ->required()
      ->type_name("SWEEP.yaml|DIR|STACK.tif|VIDEO.mp4");
  AddReadingOptions(command, sweep);
  AddVideoOptions(command, sweep);
  command->add_option("--camera", sweep->camera_path, "Camera file, instead of the sweep's own")
      ->type_name("CAMERA.yaml");
  command->add_option("--truth", sweep->truth_path, "True values to compare with (of a simulation)")
      ->type_name("FILE");
  AddSweepStatements(command, sweep);
}

}  // namespace

void AddCalibrateCommand(CLI::App* program, CommandAction* action) {
  CLI::App* command = program->add_subcommand(
      "calibrate", "Image distance, blur ratio, blur floor and bench offset from a focus sweep");
  const auto options = std::make_shared<CalibrateOptions>();
  AddSweepOptions(command, &options->sweep);
  command->add_option("-o,--output", options->camera_output, "Calibrated camera to write")
      ->type_name("CAMERA.yaml");
  command
      ->add_option("--report", options->report_folder,
                   "Folder for index.html, a page with the results, and its figures as SVG")
      ->type_name("DIR");
  CLI::Option* method =
      command->add_option("--method", options->method, "fit, or paper: the paper's method")
          ->check(CLI::IsMember({"fit", "paper"}))
          ->type_name("NAME");
  AcceptDeprecatedValues(method, &options->common);
  AddCircleOptions(command, &options->circle);
  AddSweepOutputOptions(command, &options->more);
  command->add_flag("--no-field", options->no_field,
                    "Skip the maps over the field and the colours; faster");
  CLI::Option* dry_run = command->add_flag("--dry-run", options->dry_run,
                                           "Report what the sweep file says, and measure nothing");
  command
      ->add_flag("--watch", options->watch,
                 "SWEEP is a folder into which the frames are being written: print a line for each "
                 "frame, and what is still missing. Enter, a file named done in the folder or "
                 "Ctrl-C ends the sweep, and its result follows")
      ->excludes(dry_run);
  AddNumberWithUnit(command, "--watch-pause", "s", "60s",
                    "With --watch: also end the sweep if nothing arrives for that time",
                    &options->watch_pause_s);
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      RequireDistinctFiles({options->camera_output, options->report_path(), options->figures_path(),
                            options->more.image, options->more.focus_map, options->more.psf,
                            options->common.json_path},
                           options->sweep.Files());
      CheckSweepOutputs(options->more);
      RunCommand(options->common, [&] { return Calibrate(*options); });
    };
  });
}

}  // namespace thicklens::tools
