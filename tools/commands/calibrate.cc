// thicklens calibrate: from a focus sweep to a camera with its image distance and blur.
#include "thicklens/calib/calibrate.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/base/utc_time.h"
#include "thicklens/model/camera_file.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/option_values.h"
#include "tools/options/sweep_input.h"
#include "tools/options/sweep_options.h"
#include "tools/report/calibration_json.h"
#include "tools/report/calibration_report.h"
#include "tools/report/calibration_summary.h"
#include "tools/report/input_summary.h"
#include "tools/report/report_folder.h"
#include "tools/system/build_info.h"
#include "tools/system/progress_line.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

struct CalibrateOptions {
  CommonOptions common;
  SweepArguments sweep;
  std::string camera_output;  // empty: no camera file
  std::string report_folder;  // empty: no report
  std::string method = "fit";
  bool map_field = true;
  bool dry_run = false;

  bool use_source_recipe() const { return method == "source"; }
  std::string report_path() const {
    return report_folder.empty() ? "" : (fs::path(report_folder) / "report.html").string();
  }
  std::string figures_path() const {
    return report_folder.empty() ? "" : (fs::path(report_folder) / "figures").string();
  }
};

// A folder with this file was written by this program.
constexpr char kCaptions[] = "captions.txt";

std::vector<std::string> OwnFigureFiles() {
  std::vector<std::string> names = ReportFigureNames();
  names.emplace_back(kCaptions);
  return names;
}

// Outputs are claimed before anything is measured, so that an invalid output is reported at once.
struct Outputs {
  explicit Outputs(const CalibrateOptions& options) : folder(options.report_folder) {
    if (!options.camera_output.empty()) camera.emplace(options.camera_output);
    if (options.report_folder.empty()) return;
    report.emplace(options.report_path());
    figures.emplace(options.figures_path(), kCaptions, OwnFigureFiles());
  }

  ReportFolder folder;
  std::optional<OutputFile> camera;
  std::optional<OutputFile> report;
  std::optional<OutputFolder> figures;
};

const model::SweepTruth* TruthOf(const SweepInput& input) {
  return input.truth ? &*input.truth : nullptr;
}

// Returns the reason why there is no camera to write; empty if there is one.
std::string RefusalOf(const calib::Calibration& calibration, bool use_source_recipe) {
  if (use_source_recipe) return calibration.source.done ? "" : calibration.source.message;
  return calibration.outcome == calib::Outcome::kRefused ? calibration.reason : "";
}

calib::Calibration Measure(const SweepInput& input, const CalibrateOptions& asked) {
  ProgressLine progress("measuring", asked.common.quiet);
  calib::CalibrationOptions options;
  options.map_field = asked.map_field;
  options.threads = asked.common.threads;
  options.progress = [&](int done, int total) {
    progress.Show(done, total);
    return !IsCancelled();
  };
  return calib::Calibrate(input.sweep, options);
}

model::Camera CameraWithEvidence(const SweepInput& input, const calib::Calibration& calibration,
                                 const std::string& date, bool use_source_recipe) {
  model::Camera camera =
      calib::CalibratedCamera(input.sweep.camera, calibration, use_source_recipe);
  if (!camera.calibration) return camera;
  model::Evidence& evidence = camera.calibration->evidence;
  evidence.data_sha256 = input.frame_files->DataSha256();
  evidence.version = Version();
  evidence.date = date;
  return camera;
}

CalibrationReport Report(const CalibrateOptions& options, const SweepInput& input,
                         const calib::Calibration& calibration, const std::string& date) {
  const ReportOrigin origin{options.sweep.input, Version(), date, input.notices,
                            input.file.reading_sigma_stated};
  return MakeCalibrationReport(input.sweep, calibration, TruthOf(input), origin,
                               input.sweep.read_frame);
}

// All texts are made, and the figures written to temporary files, before the first file is put in
// place.
void WriteOutputs(const CalibrateOptions& options, const SweepInput& input,
                  const calib::Calibration& calibration, bool refused, Outputs* outputs) {
  const std::string date = NowIso8601();
  std::string camera;
  CalibrationReport report;
  if (outputs->camera && !refused) {
    camera = model::CameraToYaml(
        CameraWithEvidence(input, calibration, date, options.use_source_recipe()));
  }
  if (outputs->report) {
    report = Report(options, input, calibration, date);
    for (const ReportFile& figure : report.figures)
      outputs->figures->Write(figure.name, figure.content);
    outputs->figures->Write(kCaptions, report.captions);
  }
  ThrowIfCancelled();
  if (outputs->report) {
    outputs->report->Commit(report.html);
    outputs->figures->Commit();
    spdlog::debug("{} written", options.report_path());
  }
  if (!camera.empty()) {
    outputs->camera->Commit(camera);
    spdlog::debug("{} written", options.camera_output);
  }
}

CommandResult RunCalibration(const CalibrateOptions& options, const SweepInput& input) {
  Outputs outputs(options);
  const calib::Calibration calibration = Measure(input, options);
  ThrowIfCancelled();
  const std::string refusal = RefusalOf(calibration, options.use_source_recipe());
  WriteOutputs(options, input, calibration, !refusal.empty(), &outputs);
  if (options.common.quiet) {  // otherwise they are part of the text
    for (const std::string& warning : calibration.warnings)
      spdlog::warn("{}", PrintableUtf8(warning));
  }
  // A refusal before any measurement is one line on stderr.
  if (refusal.empty() || calibration.source.done)
    PrintResult(options.common, CalibrationText(input.sweep, calibration, TruthOf(input)));
  CommandResult result;
  result.is_written = outputs.camera || outputs.report;
  result.summary =
      CalibrationJson(input.sweep, calibration, TruthOf(input), options.use_source_recipe());
  if (!refusal.empty())
    result.refusal = PrintableUtf8(fmt::format("{}: {}", options.sweep.input, refusal));
  return result;
}

std::string OutputsText(const CalibrateOptions& options) {
  std::vector<std::string> outputs;
  for (const std::string& path : {options.camera_output, options.report_path(),
                                  options.figures_path(), options.common.json_path}) {
    if (!path.empty()) outputs.push_back(PrintableUtf8(path));
  }
  return outputs.empty() ? "nothing" : fmt::format("{}", fmt::join(outputs, ", "));
}

CommandResult RunDry(const CalibrateOptions& options, const SweepInput& input) {
  const Understanding found = Understand(input);
  { const Outputs could_be_written(options); }
  PrintResult(options.common,
              UnderstandingText(input, found, options.method, OutputsText(options)));
  return {UnderstandingJson(input, found, options.method), ""};
}

CommandResult Calibrate(const CalibrateOptions& options) {
  const SweepInput input = ReadSweepInput(options.sweep);
  for (const std::string& notice : input.notices) spdlog::warn("{}", PrintableUtf8(notice));
  ReportAssumedFields(input.sweep.camera);
  return options.dry_run ? RunDry(options, input) : RunCalibration(options, input);
}

void AddSweepOptions(CLI::App* command, SweepArguments* sweep) {
  command
      ->add_option("sweep", sweep->input,
                   "Sweep description, or a folder of frames with --readings and --camera")
      ->required()
      ->type_name("SWEEP.yaml|DIR");
  command->add_option("--readings", sweep->readings_csv, "Table for a folder: file, reading in mm")
      ->type_name("CSV");
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
                   "Folder for report.html with its figures as SVG")
      ->type_name("DIR");
  command->add_option("--method", options->method, "fit, or source: the paper's baseline method")
      ->check(CLI::IsMember({"fit", "source"}))
      ->type_name("NAME");
  command->add_flag("!--no-field", options->map_field,
                    "Skip the maps over the field and the colours; faster");
  command->add_flag("--dry-run", options->dry_run,
                    "Report what the sweep file says, and measure nothing");
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      RequireDistinctFiles({options->camera_output, options->report_path(), options->figures_path(),
                            options->common.json_path},
                           options->sweep.Files());
      RunCommand(options->common, [&] { return Calibrate(*options); });
    };
  });
}

}  // namespace thicklens::tools
