// thicklens undistort: takes the distortion of the lens out of images and depth maps.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/camera.h"
#include "thicklens/distortion.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_file.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/distortion_option.h"
#include "tools/options/interface_options.h"
#include "tools/options/option_values.h"
#include "tools/report/distortion_words.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

constexpr double kPercent = 100;

struct UndistortOptions {
  CommonOptions common;
  std::string distortion, camera_path, folder, transfer;
  std::vector<std::string> files;
  bool is_depth = false;
};

// An output without the ending of its name, which depends on the values of the image.
std::string StemOf(const UndistortOptions& options, const std::string& file) {
  return (fs::path(options.folder) / fs::path(file).stem()).string();
}

// Throws UsageError if two images would get one name.
void RequireDistinctNames(const UndistortOptions& options) {
  std::map<std::string, std::string> of_stem;
  for (const std::string& file : options.files) {
    const auto [other, is_new] = of_stem.emplace(StemOf(options, file), file);
    if (is_new) continue;
    throw UsageError(
        fmt::format("{} and {}: both would be written as {}: undistort them into different folders",
                    other->second, file, other->first));
  }
}

std::pair<int, int> SizeOf(const std::string& path, bool is_depth) {
  if (is_depth) {
    const model::RawDepthMap map = io::ReadDepthMap(path);
    return {map.width_px, map.height_px};
  }
  const io::ImageFacts facts = io::ReadImageData(path).facts;
  return {facts.width_px, facts.height_px};
}

// The distortion that is stated. A file without a size of its photographs has that of the first
// image.
LensDistortion DistortionFor(const UndistortOptions& options) {
  if (options.camera_path.empty()) {
    const CommandRun run(options.common, {{"distortion", "--distortion"}});
    const auto [width_px, height_px] = SizeOf(options.files.front(), options.is_depth);
    return ReadLensDistortion(options.distortion, width_px, height_px, run.control());
  }
  const Camera camera = ReadCamera(options.camera_path);
  if (camera.distortion) return *camera.distortion;
  throw Error(fmt::format("{}: it states no lens.distortion: --distortion FILE is needed",
                          options.camera_path));
}

// The folder is made when there is something to write.
void MakeFolder(const std::string& folder) {
  std::error_code failure;
  fs::create_directories(folder, failure);
  if (!failure && fs::is_directory(folder, failure)) return;
  throw Error(fmt::format("{}: a folder is expected, and it cannot be made{}", folder,
                          failure ? ": " + failure.message() : ""));
}

// Reads and writes one image. Returns what the summary says of it.
nlohmann::json UndistortOne(const UndistortOptions& options, const LensDistortion& distortion,
                            const std::string& path, std::string* text) {
  UndistortFileOptions how;
  how.is_depth = options.is_depth;
  if (!options.transfer.empty()) how.transfer = TransferCurve::FromName(options.transfer);
  if (!options.camera_path.empty())
    how.assumed_transfer = ReadCamera(options.camera_path).sensor.transfer;
  const UndistortedFile file = UndistortFile(path, distortion, how);
  const std::string output = StemOf(options, path) + file.ending;
  ThrowIfCancelled();
  MakeFolder(options.folder);
  WriteFileAtomically(output, file.bytes);
  if (!file.remark.empty()) spdlog::warn("{}: {}", PrintableUtf8(path), PrintableUtf8(file.remark));
  const double share = static_cast<double>(file.without_source) /
                       (static_cast<double>(file.width_px) * file.height_px);
  *text += fmt::format(
      "{:<12} {} x {} px, {}{}\n", "undistorted", file.width_px, file.height_px, file.values,
      file.without_source == 0
          ? ", every pixel has a source"
          : fmt::format(", {:.2g} % of the pixels have no source ({})", kPercent * share,
                        !options.is_depth       ? "black"
                        : file.ending == ".pfm" ? "NaN"
                                                : "0"));
  *text += WrittenText({output});
  return {{"image", PrintableUtf8(path)},
          {"output", PrintableUtf8(output)},
          {"size_px", {file.width_px, file.height_px}},
          {"values", file.values},
          {"without_source_share", share}};
}

CommandResult Undistort(const UndistortOptions& options) {
  const LensDistortion distortion = DistortionFor(options);
  CommandResult result;
  result.summary = {{"status", "ok"},
                    {"reason", ""},
                    {"distortion", DistortionJson(distortion)},
                    {"images", nlohmann::json::array()}};
  std::string text = fmt::format("distortion   {}\n", DistortionWords(distortion));
  for (const std::string& file : options.files)
    result.summary["images"].push_back(UndistortOne(options, distortion, file, &text));
  result.is_written = true;
  PrintResult(options.common, text);
  return result;
}

}  // namespace

void AddUndistortCommand(CLI::App* program, CommandAction* action) {
  CLI::App* command = program->add_subcommand(
      "undistort", "Take the distortion of the lens out of images and depth maps");
  const auto options = std::make_shared<UndistortOptions>();
  command->add_option("images", options->files, "The images, or with --depth the depth maps")
      ->required()
      ->type_name("IMAGE...");
  CLI::Option* distortion =
      command
          ->add_option("--distortion", options->distortion,
                       "File of the distortion: OpenCV (YAML, XML, JSON), ROS camera_info, Kalibr "
                       "camchain, COLMAP cameras.txt or cameras.bin, mrcal .cameramodel; "
                       "FILE:CAMERA in a file of several")
          ->type_name("FILE[:CAMERA]");
  command
      ->add_option("--camera", options->camera_path,
                   "Camera file that states lens.distortion, instead of --distortion")
      ->excludes(distortion)
      ->type_name("CAMERA.yaml");
  command
      ->add_option("-o,--output", options->folder,
                   "Folder for the images, which get the names of the inputs")
      ->required()
      ->type_name("DIR");
  command->add_flag("--depth", options->is_depth,
                    "The files are depth maps: each pixel takes the nearest value, and one that "
                    "the map does not show is a hole");
  command
      ->add_option("--transfer", options->transfer,
                   "Transfer curve of images of integers, which are interpolated in linear light; "
                   "default: the one that the file states, or srgb")
      ->check(TransferCurveName())
      ->type_name("CURVE");
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      if (options->distortion.empty() && options->camera_path.empty())
        throw UsageError("--distortion or --camera is needed: the file that states the distortion");
      RequireDistinctNames(*options);
      std::vector<std::string> inputs = options->files;
      inputs.push_back(FileOfDistortion(options->distortion));
      inputs.push_back(options->camera_path);
      std::vector<std::string> outputs = {options->common.json_path};
      for (const std::string& file : options->files) {
        for (const char* ending :
             {".png", ".tif", ".tiff", ".exr", ".bmp", ".pgm", ".ppm", ".pnm", ".pfm"})
          outputs.push_back(StemOf(*options, file) + ending);
      }
      RequireDistinctFiles(outputs, inputs);
      RunCommand(options->common, [&] { return Undistort(*options); });
    };
  });
}

}  // namespace thicklens::tools
