// thicklens calibrate: from a focus sweep to a camera that knows its image distance and blur.
#include "thicklens/calib/calibrate.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <vector>

#include "build_info.h"
#include "calibration_report.h"
#include "calibration_summary.h"
#include "commands.h"
#include "interrupt.h"
#include "option_values.h"
#include "progress_line.h"
#include "svg_plot.h"
#include "sweep_input.h"
#include "thicklens/error.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/output_file.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

struct CalibrateOptions {
  CommonOptions common;
  SweepArguments sweep;
  std::string camera_output;  // empty: no camera file
  std::string report_folder;  // empty: no report
  std::string method = "fit";
  bool dry_run = false;

  bool use_source_recipe() const { return method == "source"; }
  std::string report_path() const {
    return report_folder.empty() ? "" : (fs::path(report_folder) / "report.html").string();
  }
};

// A folder that is made if it is missing, and goes again if nothing came into it.
class ReportFolder {
 public:
  explicit ReportFolder(const std::string& path) : path_(path) {
    std::error_code failure;
    if (path.empty() || fs::exists(path, failure)) return;
    made_ = fs::create_directory(path, failure);
    if (failure)
      throw Error(fmt::format("{}: the folder cannot be made: {}", path, failure.message()));
  }
  ~ReportFolder() {
    std::error_code not_empty;
    if (made_) fs::remove(path_, not_empty);
  }
  ReportFolder(const ReportFolder&) = delete;
  ReportFolder& operator=(const ReportFolder&) = delete;

 private:
  fs::path path_;
  bool made_ = false;
};

// Claimed before anything is measured, so that an output that cannot be is told at once.
struct Outputs {
  explicit Outputs(const CalibrateOptions& options) : folder(options.report_folder) {
    if (!options.camera_output.empty()) camera.emplace(options.camera_output);
    if (!options.report_folder.empty()) report.emplace(options.report_path());
  }

  ReportFolder folder;
  std::optional<model::OutputFile> camera;
  std::optional<model::OutputFile> report;
};

const model::SweepTruth* TruthOf(const SweepInput& input) {
  return input.truth ? &*input.truth : nullptr;
}

// Why there is no camera to write; empty: there is one.
std::string RefusalOf(const calib::Calibration& calibration, bool use_source_recipe) {
  if (use_source_recipe) return calibration.source.done ? "" : calibration.source.message;
  return calibration.outcome == calib::Outcome::kRefused ? calibration.reason : "";
}

calib::Calibration Measure(const SweepInput& input, const CommonOptions& common) {
  ProgressLine progress("measuring", common.quiet);
  calib::CalibrationOptions options;
  options.threads = common.threads;
  options.progress = [&](int done, int total) {
    progress.Show(done, total);
    return !InterruptRequested();
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

std::string ReportHtml(const CalibrateOptions& options, const SweepInput& input,
                       const calib::Calibration& calibration, const std::string& date) {
  const ReportOrigin origin{options.sweep.input, Version(), date, input.notices};
  return CalibrationReportHtml(input.sweep, calibration, TruthOf(input), origin);
}

// All texts are made before the first file is put in place.
void WriteOutputs(const CalibrateOptions& options, const SweepInput& input,
                  const calib::Calibration& calibration, bool refused, Outputs* outputs) {
  const std::string date = NowIso8601();
  std::string camera, report;
  if (outputs->camera && !refused) {
    camera = model::CameraToYaml(
        CameraWithEvidence(input, calibration, date, options.use_source_recipe()));
  }
  if (outputs->report) report = ReportHtml(options, input, calibration, date);
  ThrowIfInterrupted();
  if (!report.empty()) {
    outputs->report->Commit(report);
    spdlog::debug("{} written", options.report_path());
  }
  if (!camera.empty()) {
    outputs->camera->Commit(camera);
    spdlog::debug("{} written", options.camera_output);
  }
}

CommandResult RunCalibration(const CalibrateOptions& options, const SweepInput& input) {
  Outputs outputs(options);
  const calib::Calibration calibration = Measure(input, options.common);
  ThrowIfInterrupted();
  const std::string refusal = RefusalOf(calibration, options.use_source_recipe());
  WriteOutputs(options, input, calibration, !refusal.empty(), &outputs);
  if (options.common.quiet) {  // else they stand in the text
    for (const std::string& warning : calibration.warnings)
      spdlog::warn("{}", PrintableUtf8(warning));
  }
  // A refusal before anything was measured is one line, on stderr.
  if (refusal.empty() || calibration.source.done)
    PrintResult(options.common, CalibrationText(input.sweep, calibration, TruthOf(input)));
  CommandResult result;
  result.summary =
      CalibrationJson(input.sweep, calibration, TruthOf(input), options.use_source_recipe());
  if (!refusal.empty())
    result.refusal = PrintableUtf8(fmt::format("{}: {}", options.sweep.input, refusal));
  return result;
}

// What a dry run finds out without measuring.
struct Understanding {
  cv::Size frame_size_px;
  int frame_bits = 0, frame_channels = 0;
  double min_reading_mm = 0, max_reading_mm = 0, median_step_mm = 0;
  std::size_t distinct_readings = 0;
};

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Opens the first frame alone, so that it takes no longer for a large sweep. Throws Error for what
// would stop the calibration.
Understanding Understand(const SweepInput& input) {
  std::string why;
  if (!input.sweep.IsValid(&why)) throw Error(fmt::format("{}: {}", input.file.source, why));
  if (!calib::HasEnoughFrames(input.sweep, &why))
    throw Error(fmt::format("{}: {}", input.file.source, why));
  const cv::Mat first = input.sweep.read_frame(0);
  calib::LinearGrey(first, input.sweep, 0);
  std::set<double> readings;
  for (const model::SweepFrame& frame : input.sweep.frames) readings.insert(frame.reading_mm);
  std::vector<double> steps;
  for (auto reading = std::next(readings.begin()); reading != readings.end(); ++reading)
    steps.push_back(*reading - *std::prev(reading));
  return {first.size(),       first.depth() == CV_8U ? 8 : 16,
          first.channels(),   *readings.begin(),
          *readings.rbegin(), Median(steps),
          readings.size()};
}

// Depths of the nearest and the farthest frame, where the offset is known.
std::optional<std::pair<double, double>> DepthRangeMm(const SweepInput& input,
                                                      const Understanding& found) {
  if (!input.sweep.offset_mm) return std::nullopt;
  const double sign = model::DirectionSign(input.sweep.direction);
  return std::minmax(input.sweep.offset_mm->value + sign * found.min_reading_mm,
                     input.sweep.offset_mm->value + sign * found.max_reading_mm);
}

std::string EstimateText(const std::optional<model::Estimate>& estimate, const char* unit) {
  if (!estimate) return "unknown";
  if (!(estimate->sigma > 0)) return fmt::format("{:.6g} {}", estimate->value, unit);
  return fmt::format("{:.6g} +- {:.2g} {}", estimate->value, estimate->sigma, unit);
}

std::string FloorText(const model::FloorKnowledge& floor) {
  if (floor.from_px) return fmt::format("{:.4g} to {:.4g} px", *floor.from_px, *floor.to_px);
  return EstimateText(floor.given_px, "px");
}

std::string CameraText(const model::Camera& camera) {
  const model::ThickLens& lens = camera.lens;
  return fmt::format(
      "camera     {}: f1 {:.6g} mm, f2 {:.6g} mm, thickness {:.6g} mm, aperture radius {:.6g} mm\n"
      "           {} x {} px of {:.6g} mm, principal point ({:.6g}, {:.6g}) px, {}, PSF {}\n",
      PrintableUtf8(camera.name), lens.front_focal_length_mm, lens.rear_focal_length_mm,
      lens.lens_thickness_mm, lens.aperture_radius_mm, camera.sensor.width_px,
      camera.sensor.height_px, camera.sensor.pixel_pitch_mm, camera.sensor.principal_point_px.x(),
      camera.sensor.principal_point_px.y(), camera.sensor.transfer.Name(),
      model::PsfName(camera.psf));
}

std::string BenchText(const SweepInput& input, const Understanding& found) {
  const auto depths = DepthRangeMm(input, found);
  return fmt::format(
      "readings   {:.6g} to {:.6g} mm, {} distinct, step {:.4g} mm (median), sigma {:.3g} mm\n"
      "bench      direction {}, offset {}\n"
      "depths     {}\n",
      found.min_reading_mm, found.max_reading_mm, found.distinct_readings, found.median_step_mm,
      input.sweep.reading_sigma_mm, model::BenchDirectionName(input.sweep.direction),
      EstimateText(input.sweep.offset_mm, "mm"),
      depths ? fmt::format("{:.6g} to {:.6g} mm from the aperture", depths->first, depths->second)
             : "follow from the offset, which is to be found from the image scale");
}

std::string OutputsText(const CalibrateOptions& options) {
  std::vector<std::string> outputs;
  for (const std::string& path :
       {options.camera_output, options.report_path(), options.common.json_path}) {
    if (!path.empty()) outputs.push_back(PrintableUtf8(path));
  }
  return outputs.empty() ? "nothing" : fmt::format("{}", fmt::join(outputs, ", "));
}

std::string UnderstandingText(const CalibrateOptions& options, const SweepInput& input,
                              const Understanding& found) {
  const model::RegionOfInterest& roi = input.sweep.roi;
  return fmt::format(
      "frames     {}, the first {} x {} px, {} bit, {} channel{}\n{}{}"
      "region     {}\n"
      "target     {}, blur floor {}\n"
      "method     {}\n"
      "output     {}\n"
      "dry run: nothing was measured\n",
      input.sweep.frames.size(), found.frame_size_px.width, found.frame_size_px.height,
      found.frame_bits, found.frame_channels, found.frame_channels == 1 ? "" : "s",
      BenchText(input, found), CameraText(input.sweep.camera),
      roi.width > 0 ? fmt::format("{} x {} px from ({}, {})", roi.width, roi.height, roi.x, roi.y)
                    : "the whole field",
      model::SweepTargetName(input.sweep.target), FloorText(input.sweep.floor), options.method,
      OutputsText(options));
}

nlohmann::json UnderstandingJson(const CalibrateOptions& options, const SweepInput& input,
                                 const Understanding& found) {
  nlohmann::json json = {{"status", "ok"},
                         {"reason", ""},
                         {"dry_run", true},
                         {"method", options.method},
                         {"camera", input.sweep.camera.name},
                         {"frames", input.sweep.frames.size()},
                         {"width_px", found.frame_size_px.width},
                         {"height_px", found.frame_size_px.height},
                         {"bits", found.frame_bits},
                         {"channels", found.frame_channels},
                         {"min_reading_mm", found.min_reading_mm},
                         {"max_reading_mm", found.max_reading_mm},
                         {"median_step_mm", found.median_step_mm},
                         {"distinct_readings", found.distinct_readings},
                         {"reading_sigma_mm", input.sweep.reading_sigma_mm},
                         {"direction", model::BenchDirectionName(input.sweep.direction)},
                         {"target", model::SweepTargetName(input.sweep.target)},
                         {"offset_mm", nullptr},
                         {"depth_range_mm", nullptr}};
  if (input.sweep.offset_mm) {
    json["offset_mm"] = {{"value", input.sweep.offset_mm->value},
                         {"sigma", input.sweep.offset_mm->sigma}};
  }
  if (const auto depths = DepthRangeMm(input, found))
    json["depth_range_mm"] = {depths->first, depths->second};
  return json;
}

CommandResult RunDry(const CalibrateOptions& options, const SweepInput& input) {
  const Understanding found = Understand(input);
  { const Outputs could_be_written(options); }
  PrintResult(options.common, UnderstandingText(options, input, found));
  return {UnderstandingJson(options, input, found), ""};
}

CommandResult Calibrate(const CalibrateOptions& options) {
  const SweepInput input = ReadSweepInput(options.sweep);
  for (const std::string& notice : input.notices) spdlog::warn("{}", PrintableUtf8(notice));
  TellAssumedFields(input.sweep.camera);
  return options.dry_run ? RunDry(options, input) : RunCalibration(options, input);
}

void AddSweepOptions(CLI::App* command, SweepArguments* sweep) {
  command
      ->add_option("sweep", sweep->input,
                   "The sweep's description, or a folder of frames with --readings and --camera")
      ->required()
      ->type_name("SWEEP.yaml|DIR");
  command->add_option("--readings", sweep->readings_csv, "Table of a folder: file, reading in mm")
      ->type_name("CSV");
  command->add_option("--camera", sweep->camera_path, "The camera, instead of the sweep's own")
      ->type_name("CAMERA.yaml");
  command->add_option("--truth", sweep->truth_path, "Truth to compare with (of a simulation)")
      ->type_name("FILE");
  const std::string instead = "; replaces what the sweep's file says";
  command->add_option("--offset-mm", sweep->offset_mm, "Depth of reading 0, or unknown" + instead)
      ->type_name("MM");
  command->add_option("--offset-sigma-mm", sweep->offset_sigma_mm, "Its standard deviation")
      ->check(NonNegative())
      ->type_name("MM");
  command
      ->add_option("--direction", sweep->direction,
                   "away: larger readings are farther; toward: nearer" + instead)
      ->check(CLI::IsMember({"away", "toward"}))
      ->type_name("WAY");
  command
      ->add_option("--reading-sigma-mm", sweep->reading_sigma_mm,
                   "Standard deviation of a reading" + instead)
      ->check(NonNegative())
      ->type_name("MM");
  command
      ->add_option("--floor-px", sweep->floor_px,
                   "Blur of the lens at perfect focus, VALUE, VALUE:SIGMA or unknown" + instead)
      ->type_name("PX");
  command->add_option("--target", sweep->target, "What is photographed" + instead)
      ->check(CLI::IsMember({"auto", "texture", "printed-edge", "knife-edge"}))
      ->type_name("KIND");
  command->add_option("--roi", sweep->roi, "Part of the frames to measure in" + instead)
      ->type_name("X,Y,WIDTH,HEIGHT");
}

}  // namespace

void AddCalibrateCommand(CLI::App* program, CommandAction* action) {
  CLI::App* command = program->add_subcommand(
      "calibrate", "Image distance, blur ratio, blur floor and bench offset from a focus sweep");
  const auto options = std::make_shared<CalibrateOptions>();
  AddSweepOptions(command, &options->sweep);
  command->add_option("-o,--output", options->camera_output, "The calibrated camera")
      ->type_name("CAMERA.yaml");
  command->add_option("--report", options->report_folder, "Folder for report.html")
      ->type_name("DIR");
  command->add_option("--method", options->method, "fit, or source: the source's own recipe")
      ->check(CLI::IsMember({"fit", "source"}))
      ->type_name("NAME");
  command->add_flag("--dry-run", options->dry_run,
                    "Tell what is understood of the sweep and measure nothing");
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      RequireDistinctFiles(
          {options->camera_output, options->report_path(), options->common.json_path},
          options->sweep.Files());
      RunCommand(options->common, [&] { return Calibrate(*options); });
    };
  });
}

}  // namespace thicklens::tools
