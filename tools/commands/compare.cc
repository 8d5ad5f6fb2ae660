// thicklens compare: compares an image or a light field with the true one.
#include "thicklens/compare.h"

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/depth.h"
#include "thicklens/image.h"
#include "thicklens/io/files_read.h"
#include "thicklens/light_field.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/interface_options.h"
#include "tools/options/light_field_options.h"
#include "tools/options/option_values.h"
#include "tools/options/with_file_context.h"
#include "tools/report/compare_table.h"
#include "tools/report/files_read_json.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;
using Rect = std::optional<model::PixelRect>;

constexpr int kMaxBorderPx = 100000;

struct CompareOptions {
  CommonOptions common;
  std::string reference_path, other_path;
  int border_px = 0;
  ReadingOptions reading;
  std::vector<std::string> dibr_paths;  // empty, or the photograph and its depth map
  DepthOptions depth;
  std::vector<std::string> without;  // effects that the photograph of --dibr lacks
};

bool IsFolder(const std::string& path) {
  std::error_code failure;
  const fs::file_status status = fs::status(path, failure);
  if (!fs::exists(status))
    throw Error(fmt::format("{}: there is no such file or folder", PrintableUtf8(path)));
  return fs::is_directory(status);
}

// Returns false for an image that has the rectangle's size already: it was cropped before.
bool IsToCrop(const Rect& crop, int width_px, int height_px) {
  return crop && (crop->width != width_px || crop->height != height_px);
}

Image ReadCroppedImage(const std::string& path, const Rect& crop,
                       std::shared_ptr<const io::ImageFacts>* facts = nullptr) {
  Image image = thicklens::ReadImage(path);
  if (facts != nullptr) *facts = image.facts();
  return IsToCrop(crop, image.width_px(), image.height_px()) ? image.Cropped(*crop) : image;
}

OptionNames CompareOptionNames() {
  return {
      {"border_px", "--border"}, {"baseline", "--dibr"}, {"depth.meaning.kind", "--depth-kind"}};
}

// ---- Two images.

CommandResult CompareImageFiles(const CompareOptions& options) {
  const LightFieldReadOptions reading = LightFieldReadOptionsOf(options.reading);
  if (reading.hci_grid > 0 || reading.allow_missing_views || reading.inner_views ||
      !options.dibr_paths.empty()) {
    throw UsageError(
        fmt::format("--grid, --sparse, --views and --dibr are for light fields, but {} is an image",
                    PrintableUtf8(options.reference_path)));
  }
  Image reference = thicklens::ReadImage(options.reference_path);
  const auto reference_facts = reference.facts();
  if (reading.crop) reference = reference.Cropped(*reading.crop);
  std::shared_ptr<const io::ImageFacts> other_facts;
  const Image other = ReadCroppedImage(options.other_path, reading.crop, &other_facts);
  thicklens::CompareOptions asked;
  asked.border_px = options.border_px;
  const ImageScores scores = CompareImages(reference, other, asked);
  const std::vector<io::FilesRead> read = {{{options.reference_path}, *reference_facts},
                                           {{options.other_path}, *other_facts}};
  PrintResult(options.common, fmt::format("reference  {}\nother      {}\n",
                                          PrintableUtf8(reference_facts->OneLine()),
                                          PrintableUtf8(other_facts->OneLine())) +
                                  ImageScoresText(scores, options.border_px));
  CommandResult result;
  result.summary = ImageScoresJson(scores);
  result.summary["read"] = FilesReadJson(read);
  result.summary["status"] = "ok";
  result.summary["reason"] = "";
  result.summary["size"] = {reference.width_px(), reference.height_px()};
  result.summary["border_px"] = options.border_px;
  return result;
}

// ---- Two light fields.

// The photograph of --dibr and its depth map.
Baseline ReadBaseline(const CompareOptions& options, const Rect& crop, bool has_camera) {
  DepthOptions depth = options.depth;
  // Without a camera the map can only hold disparities.
  if (depth.kind.empty() && !has_camera) depth.kind = "disparity";
  Baseline baseline;
  baseline.photo = ReadCroppedImage(options.dibr_paths.front(), crop);
  baseline.depth =
      ReadDepth(options.dibr_paths.back(), DepthMeaningOf(depth), DepthReadOptionsOf(depth));
  if (IsToCrop(crop, baseline.depth.width_px, baseline.depth.height_px))
    baseline.depth = baseline.depth.Cropped(*crop);
  baseline.remove_falloff = options.without.empty();
  return baseline;
}

LightFieldScores ScoresOf(const CompareOptions& options, const RunControl& run) {
  LightFieldReadOptions reading = LightFieldReadOptionsOf(options.reading);
  LightField reference = ReadLightField(options.reference_path, reading, run);
  const Rect crop = std::exchange(reading.crop, std::nullopt);
  LightField other = ReadLightField(options.other_path, reading, run);
  if (IsToCrop(crop, other.s_count, other.t_count))
    other = WithFileContext(options.other_path, [&] { return model::CropViews(other, *crop); });
  thicklens::CompareOptions asked;
  asked.border_px = options.border_px;
  if (!options.dibr_paths.empty()) {
    asked.baseline = ReadBaseline(options, crop, reference.camera.has_value());
  }
  return CompareLightFields(std::move(reference), std::move(other), std::move(asked), run);
}

CommandResult CompareFolders(const CompareOptions& options) {
  const CommandRun run(options.common, CompareOptionNames());
  const LightFieldScores scores =
      WithOptionNames(run.names(), [&] { return ScoresOf(options, run.control()); });
  PrintResult(options.common,
              LightFieldScoresText(scores, options.border_px, options.common.verbose));
  return {LightFieldScoresJson(scores, options.border_px), ""};
}

CommandResult Compare(const CompareOptions& options) {
  const bool is_folder = IsFolder(options.reference_path);
  if (is_folder != IsFolder(options.other_path)) {
    const std::string& folder = is_folder ? options.reference_path : options.other_path;
    const std::string& file = is_folder ? options.other_path : options.reference_path;
    throw Error(
        fmt::format("two images or two folders with light fields are expected, found the "
                    "folder {} and the file {}",
                    PrintableUtf8(folder), PrintableUtf8(file)));
  }
  // A file is a light field only if the options say so.
  const bool is_light_field = is_folder || !options.reading.layout.empty();
  return is_light_field ? CompareFolders(options) : CompareImageFiles(options);
}

// ---- The command line.

void AddDibrOptions(CLI::App* command, CompareOptions* options) {
  CLI::Option* dibr = command
                          ->add_option("--dibr", options->dibr_paths,
                                       "Also score depth-image-based rendering: this photograph "
                                       "warped to each view by its depth map")
                          ->expected(2)
                          ->type_name("PHOTO DEPTH");
  AddDepthOptions(command, "Required with --dibr", &options->depth);
  command
      ->add_option("--without", options->without,
                   "Effects that the photograph of --dibr lacks: falloff")
      ->check(CLI::IsMember({"falloff"}))
      ->delimiter(',')
      ->type_name("EFFECT");
  for (const char* name :
       {"--depth-kind", "--depth-unit", "--disparity-scale", "--disparity-offset", "--without"}) {
    command->get_option(name)->needs(dibr);
  }
}

}  // namespace

void AddCompareCommand(CLI::App* program, CommandAction* action) {
  CLI::App* command = program->add_subcommand(
      "compare", "PSNR, SSIM, mean CIE94 difference and edge orientation against a true image");
  const auto options = std::make_shared<CompareOptions>();
  command->add_option("reference", options->reference_path, "The true image or light field")
      ->required()
      ->type_name("REFERENCE");
  command
      ->add_option("other", options->other_path,
                   "Image or light field to compare with it. Of light fields with different "
                   "counts the inner views of the larger one are used. With --crop, an image that "
                   "has the rectangle's size already is not cropped")
      ->required()
      ->type_name("OTHER");
  command->add_option("--border", options->border_px, "Width in px of a border that is left out")
      ->check(CLI::Range(0, kMaxBorderPx))
      ->capture_default_str()
      ->type_name("PX");
  AddReadingOptions(command, &options->reading);
  AddDibrOptions(command, options.get());
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      LightFieldReadOptionsOf(options->reading);  // reports wrong usage before any work begins
      std::vector<std::string> inputs = options->dibr_paths;
      inputs.insert(inputs.end(), {options->reference_path, options->other_path});
      RequireDistinctFiles({options->common.json_path}, inputs);
      RunCommand(options->common, [&] { return Compare(*options); });
    };
  });
}

}  // namespace thicklens::tools
