// thicklens frames: averages exposures of one scene, and finds defective pixels.
#include "thicklens/frames.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/io/files_read.h"
#include "thicklens/io/image_file.h"
#include "thicklens/model/camera_file.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/interface_options.h"
#include "tools/options/option_values.h"
#include "tools/report/files_read_json.h"

namespace thicklens::tools {
namespace {

constexpr double kPercent = 100;

// How files of exposures are read.
struct ExposureOptions {
  std::string method = "clipped-mean";
  std::optional<int> full_scale;
  std::string raw, transfer, camera_path;
};

struct FramesOptions {
  CommonOptions common;
  ExposureOptions exposures;
  std::vector<std::string> files;       // frames average
  std::vector<std::string> dark, flat;  // frames defects
  std::string output, defects_output;
  calib::DefectOptions defects;
};

bool EndsIn(const std::string& path, const std::string& ending) {
  return path.size() > ending.size() &&
         path.compare(path.size() - ending.size(), std::string::npos, ending) == 0;
}

// Throws UsageError unless the name is that of a TIFF file, which holds floats and a description.
void RequireTiff(const std::string& path) {
  if (EndsIn(path, ".tif") || EndsIn(path, ".tiff")) return;
  throw UsageError(fmt::format("--output {}: a name that ends in .tif or .tiff is expected", path));
}

void RequireNameOfDefects(const std::string& option, const std::string& path) {
  for (const char* ending : {".png", ".tif", ".tiff", ".txt"}) {
    if (EndsIn(path, ending)) return;
  }
  throw UsageError(fmt::format(
      "{} {}: a name that ends in .png or .tif (an image) or .txt (a list of x and y) is expected",
      option, path));
}

OptionNames FramesOptionNames() {
  return {{"transfer", "--transfer (or --camera)"}, {"full_scale", "--full-scale"}};
}

FrameAverageOptions OptionsOf(const ExposureOptions& given) {
  FrameAverageOptions options;
  for (const auto method : {calib::FrameAveraging::kMedian, calib::FrameAveraging::kMean}) {
    if (given.method == calib::FrameAveragingName(method)) options.method = method;
  }
  options.full_scale = given.full_scale;
  if (given.raw == model::SweepRawName(model::SweepRaw::kGreen))
    options.raw = model::SweepRaw::kGreen;
  if (!given.transfer.empty()) options.transfer = TransferCurve::FromName(given.transfer);
  if (!given.camera_path.empty())
    options.transfer = model::ReadCamera(given.camera_path).sensor.transfer;
  return options;
}

AveragedFrames Averaged(const FramesOptions& options, const std::vector<std::string>& files) {
  const CommandRun run(options.common, FramesOptionNames());
  return AverageFrames(files, OptionsOf(options.exposures), run.control());
}

std::string DefectBytes(const cv::Mat& mask, const std::string& path) {
  if (EndsIn(path, ".txt")) return DefectList(mask);
  return io::EncodeImageFile(mask,
                             EndsIn(path, ".png") ? io::ImageFormat::kPng : io::ImageFormat::kTiff);
}

std::string ReadLine(const AveragedFrames& frames) {
  return frames.files_read ? io::FilesReadLine(*frames.files_read) : "32-bit floats, linear";
}

nlohmann::json ReadJson(const AveragedFrames& frames) {
  return FilesReadJson(frames.files_read ? *frames.files_read : std::vector<io::FilesRead>());
}

// Defects of a single average. A part of its level says something only where there is light.
calib::Defects DefectsOfOne(const cv::Mat& light, double mean_level,
                            const calib::DefectOptions& options) {
  constexpr double kLit = 0.05;
  return mean_level > kLit ? calib::FindDefects(cv::Mat(), light, options)
                           : calib::FindDefects(light, cv::Mat(), options);
}

nlohmann::json AverageJson(const AveragedFrames& frames) {
  const calib::FrameAverage& average = frames.average;
  return {{"frames", average.frames},
          {"size_px", {average.light.cols, average.light.rows}},
          {"channels", average.light.channels()},
          {"mean_level", average.mean_level},
          {"noise_of_one_frame", average.noise_sigma},
          {"left_out", average.left_out},
          {"clipped_share", frames.clipped_share},
          {"transfer", frames.transfer},
          {"read", ReadJson(frames)}};
}

std::string AverageText(const AveragedFrames& frames) {
  const calib::FrameAverage& average = frames.average;
  std::string text = fmt::format(
      "read         {}\nframes       {}\nmean         {:.4g} % of full scale, linear light\n"
      "noise        {:.3g} % of full scale per frame{}\n",
      PrintableUtf8(ReadLine(frames)), average.frames, kPercent * average.mean_level,
      kPercent * average.noise_sigma,
      average.frames > 1 ? "" : ", from neighbouring pixels (with what is fixed to the pixels)");
  if (average.left_out > 0)
    text += fmt::format("left out     {:.2g} % of the values\n", kPercent * average.left_out);
  if (frames.clipped_share > 0) {
    text +=
        fmt::format("clipped      {:.2g} % of the pixels of a channel, at {:.3g} of full scale\n",
                    kPercent * frames.clipped_share, frames.clipped_level);
  }
  return text;
}

// Neighbours of a defect that are themselves alike are no single pixels: shading, or a target.
void WarnOfMany(const calib::Defects& found, const std::string& source) {
  constexpr double kMany = 0.01;
  const double share =
      static_cast<double>(found.hot + found.dead) / static_cast<double>(found.mask.total());
  if (!(share > kMany)) return;
  spdlog::warn(
      "{}: {:.2g} % of the pixels differ from those around them like defects: check that the "
      "exposures have no light, or show an even surface, and raise --hot-sigmas or "
      "--flat-deviation if the sensor is like this",
      PrintableUtf8(source), kPercent * share);
}

CommandResult Average(const FramesOptions& options) {
  OutputFile output(options.output);
  std::optional<OutputFile> defects_output;
  if (!options.defects_output.empty()) defects_output.emplace(options.defects_output);
  const AveragedFrames frames = Averaged(options, options.files);
  const calib::FrameAverage& average = frames.average;
  const calib::Defects defects = DefectsOfOne(average.light, average.mean_level, options.defects);
  WarnOfMany(defects, frames.source);
  const std::string bytes = EncodeAveragedFrames(frames);
  const std::string mask = defects_output ? DefectBytes(defects.mask, options.defects_output) : "";
  ThrowIfCancelled();
  output.Commit(bytes);
  if (defects_output) defects_output->Commit(mask);
  CommandResult result;
  result.is_written = true;
  result.summary = {{"status", "ok"}, {"reason", ""}, {"method", options.exposures.method}};
  result.summary.update(AverageJson(frames));
  result.summary["hot_pixels"] = defects.hot;
  result.summary["dead_pixels"] = defects.dead;
  result.summary["output"] = PrintableUtf8(options.output);
  PrintResult(options.common,
              AverageText(frames) +
                  fmt::format("method       {}\ndefects      {} hot, {} dead pixels\n",
                              average.frames > 2 ? options.exposures.method : "mean", defects.hot,
                              defects.dead) +
                  WrittenText({options.output, options.defects_output}));
  return result;
}

CommandResult FindDefects(const FramesOptions& options) {
  OutputFile output(options.output);
  cv::Mat dark, flat;
  nlohmann::json read = nlohmann::json::object();
  std::string source;
  if (!options.dark.empty()) {
    const AveragedFrames frames = Averaged(options, options.dark);
    dark = frames.average.light;
    source = frames.source;
    read["dark"] = AverageJson(frames);
  }
  if (!options.flat.empty()) {
    const AveragedFrames frames = Averaged(options, options.flat);
    flat = frames.average.light;
    if (!dark.empty() && (dark.size() != flat.size() || dark.type() != flat.type())) {
      throw Error(fmt::format(
          "dark {} has {} x {} px with {} channel(s), but flat {} has {} x {} px with {}: both "
          "must be of the same sensor",
          source, dark.cols, dark.rows, dark.channels(), frames.source, flat.cols, flat.rows,
          flat.channels()));
    }
    source = frames.source;
    read["flat"] = AverageJson(frames);
  }
  const calib::Defects defects = calib::FindDefects(dark, flat, options.defects);
  WarnOfMany(defects, source);
  ThrowIfCancelled();
  output.Commit(DefectBytes(defects.mask, options.output));
  CommandResult result;
  result.is_written = true;
  result.summary = {{"status", "ok"},
                    {"reason", ""},
                    {"hot_pixels", defects.hot},
                    {"dead_pixels", defects.dead},
                    {"read", read},
                    {"output", PrintableUtf8(options.output)}};
  PrintResult(options.common,
              fmt::format("defects      {} hot, {} dead pixels of {} x {} px\n", defects.hot,
                          defects.dead, defects.mask.cols, defects.mask.rows) +
                  WrittenText({options.output}));
  return result;
}

void AddExposureOptions(CLI::App* command, FramesOptions* options) {
  ExposureOptions* exposures = &options->exposures;
  command
      ->add_option("--method", exposures->method,
                   "Average of each pixel: clipped-mean (the values within 4 standard deviations "
                   "of the median), median or mean")
      ->check(CLI::IsMember({"clipped-mean", "median", "mean"}))
      ->capture_default_str()
      ->type_name("NAME");
  CLI::Option* transfer =
      command
          ->add_option("--transfer", exposures->transfer,
                       "Transfer curve of the files; default: the one that they state, or linear")
          ->check(TransferCurveName())
          ->type_name("CURVE");
  command
      ->add_option("--camera", exposures->camera_path, "Camera file that states the transfer curve")
      ->excludes(transfer)
      ->type_name("CAMERA.yaml");
  constexpr int kMaxValue = 65535;
  command
      ->add_option("--full-scale", exposures->full_scale,
                   "Value in the files that stands for white, as for calibrate")
      ->check(CLI::Range(1, kMaxValue))
      ->type_name("N");
  command
      ->add_option("--raw", exposures->raw,
                   "Raw files: demosaiced (default) or green, as for calibrate")
      ->check(CLI::IsMember({"demosaiced", "green"}))
      ->type_name("KIND");
  command
      ->add_option("--hot-sigmas", options->defects.hot_sigmas,
                   "A hot pixel is brighter than the median of the 5 x 5 px around it by more than "
                   "this many robust standard deviations")
      ->check(Between(0, 1e6, "standard deviations"))
      ->capture_default_str()
      ->type_name("N");
  command
      ->add_option("--least-hot", options->defects.least_hot,
                   "and by more than this part of full scale, in linear light")
      ->check(Between(0, 1, "parts of full scale"))
      ->capture_default_str()
      ->type_name("PART");
  command
      ->add_option(
          "--flat-deviation", options->defects.flat_deviation,
          "A pixel of a flat is dead (or stuck) if it differs from the median of the 5 x 5 "
          "px around it by more than this part")
      ->check(Between(0, 1, "parts of the level"))
      ->capture_default_str()
      ->type_name("PART");
  AddCommonOptions(command, &options->common);
}

void AddAverage(CLI::App* frames, CommandAction* action) {
  CLI::App* command = frames->add_subcommand(
      "average",
      "Average exposures of one scene: darks, or flats, for calibrate --dark and --flat");
  const auto options = std::make_shared<FramesOptions>();
  command
      ->add_option("files", options->files,
                   "The exposures: images, files of several pages, or videos")
      ->required()
      ->type_name("FILE...");
  command
      ->add_option("-o,--output", options->output,
                   "File to write: .tif, 32-bit floats in linear light")
      ->required()
      ->type_name("FILE.tif");
  command
      ->add_option("--defects-out", options->defects_output,
                   "File for the defective pixels: .png or .tif (255 where a pixel is defective) "
                   "or .txt (x and y, from 0)")
      ->type_name("FILE");
  AddExposureOptions(command, options.get());
  command->callback([options, action] {
    *action = [options] {
      RequireTiff(options->output);
      if (!options->defects_output.empty())
        RequireNameOfDefects("--defects-out", options->defects_output);
      std::vector<std::string> inputs = options->files;
      inputs.push_back(options->exposures.camera_path);
      RequireDistinctFiles({options->output, options->defects_output, options->common.json_path},
                           inputs);
      RunCommand(options->common, [&] { return Average(*options); });
    };
  });
}

void AddDefects(CLI::App* frames, CommandAction* action) {
  CLI::App* command = frames->add_subcommand(
      "defects", "Find hot and dead pixels in darks and flats, for calibrate --defects");
  const auto options = std::make_shared<FramesOptions>();
  command->add_option("--dark", options->dark, "Exposures without light, or their average")
      ->type_name("FILE...");
  command->add_option("--flat", options->flat, "Exposures of an even surface, or their average")
      ->type_name("FILE...");
  command
      ->add_option("-o,--output", options->output,
                   "File to write: .png or .tif (255 where a pixel is defective) or .txt (x and y, "
                   "from 0)")
      ->required()
      ->type_name("FILE");
  AddExposureOptions(command, options.get());
  command->callback([options, action] {
    *action = [options] {
      RequireNameOfDefects("--output", options->output);
      if (options->dark.empty() && options->flat.empty())
        throw UsageError(
            "--dark or --flat is needed: hot pixels show in darks, dead ones in flats");
      std::vector<std::string> inputs = options->dark;
      inputs.insert(inputs.end(), options->flat.begin(), options->flat.end());
      inputs.push_back(options->exposures.camera_path);
      RequireDistinctFiles({options->output, options->common.json_path}, inputs);
      RunCommand(options->common, [&] { return FindDefects(*options); });
    };
  });
}

}  // namespace

void AddFramesCommand(CLI::App* program, CommandAction* action) {
  CLI::App* frames = program->add_subcommand(
      "frames", "Averages of darks and flats, and the defective pixels of a sensor");
  frames->require_subcommand(1);
  AddAverage(frames, action);
  AddDefects(frames, action);
}

}  // namespace thicklens::tools
