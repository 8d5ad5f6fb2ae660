// thicklens compare: compares an image or a light field with the true one.
#include "thicklens/compare.h"

#include <fmt/format.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/depth.h"
#include "thicklens/image.h"
#include "thicklens/io/files_read.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/light_field.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/compared_inputs.h"
#include "tools/options/embedded_depth.h"
#include "tools/options/interface_options.h"
#include "tools/options/light_field_options.h"
#include "tools/options/option_values.h"
#include "tools/options/with_file_context.h"
#include "tools/report/compare_table.h"
#include "tools/report/files_read_json.h"

namespace thicklens::tools {
namespace {

using Rect = std::optional<model::PixelRect>;

constexpr int kMaxBorderPx = 100000;

struct CompareOptions {
  CommonOptions common;
  std::string reference_path, other_path;
  int border_px = 0;
  ReadingOptions reading;
  OtherReadingOptions other_reading;
  std::vector<std::string> dibr_paths;  // empty, or the photograph and its depth map
  DepthOptions depth;
  std::vector<std::string> without;  // effects that the photograph of --dibr lacks
};

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
  OptionNames names = {
      {"border_px", "--border"}, {"baseline", "--dibr"}, {"depth.meaning.kind", "--depth-kind"}};
  return names.Add(ReadingOptionNames());
}

// ---- Two images.

CommandResult CompareImageFiles(const CompareOptions& options) {
  const LightFieldReadOptions reading = LightFieldReadOptionsOf(options.reading);
  std::vector<std::string> given;
  if (reading.hci_grid > 0) given.emplace_back("--grid");
  if (reading.allow_missing_views) given.emplace_back("--sparse");
  if (reading.inner_views) given.emplace_back("--views");
  if (!options.reading.view_order.empty()) given.emplace_back("--view-order");
  for (const std::string& name : GivenNames(options.other_reading)) given.push_back(name);
  if (!options.dibr_paths.empty()) given.emplace_back("--dibr");
  if (!given.empty()) {
    throw UsageError(fmt::format(
        "{}: only for light fields, but {} is an image; --layout states that it is a light field",
        fmt::join(given, ", "), PrintableUtf8(options.reference_path)));
  }
  for (const std::string& path : {options.reference_path, options.other_path}) {
    const std::string layout = io::LayoutThatIsStated(path);
    if (layout.empty()) continue;
    ReportNotice({Notice::Level::kWarning,
                  fmt::format("{}: its name is that of a light field, but two images are compared; "
                              "--layout {} compares two light fields",
                              PrintableUtf8(path), layout)});
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
  baseline.depth = ReadDepth(options.dibr_paths.back(), DepthMeaningOf(depth),
                             DepthReadOptionsOf(depth), DepthRun());
  if (IsToCrop(crop, baseline.depth.width_px, baseline.depth.height_px))
    baseline.depth = baseline.depth.Cropped(*crop);
  baseline.remove_falloff = options.without.empty();
  return baseline;
}

// Returns how an error about one input may come from the other, in parentheses, or nothing.
std::string OfThePair(const CompareOptions& options, const ComparedInput& input,
                      const ComparedInput& partner, const std::string& what) {
  const OtherReadingOptions& replaced = options.other_reading;
  const bool is_named_once = !options.reading.name.empty() && replaced.name.empty();
  if (is_named_once && !partner.is_own && input.is_folder == partner.is_folder &&
      what.find("no name fits") != std::string::npos) {
    return fmt::format(" (--name is for both inputs; --other-name states the names of {})",
                       PrintableUtf8(options.other_path));
  }
  // If one is a folder and the other a file, the user may have meant another pair, unless the file
  // or an option says that it is a light field.
  if (input.is_folder == partner.is_folder) return "";
  const bool is_stated = !options.reading.layout.empty() || !replaced.layout.empty() ||
                         !options.reading.name.empty() || !replaced.name.empty();
  const ComparedInput& file = input.is_folder ? partner : input;
  if (is_stated || !io::LayoutThatIsStated(file.path).empty()) return "";
  return fmt::format(
      " (two images or two light fields are expected, found the {} {} and the {} {})",
      input.is_folder ? "folder" : "file", PrintableUtf8(input.path),
      partner.is_folder ? "folder" : "file", PrintableUtf8(partner.path));
}

// Reads one of both light fields.
LightField ReadCompared(const CompareOptions& options, const ComparedInput& input,
                        const ComparedInput& partner, const LightFieldReadOptions& reading,
                        const RunControl& run) {
  try {
    return ReadLightField(input.path, reading, run);
  } catch (const Interrupted&) {
    throw;
  } catch (const OptionError&) {
    throw;
  } catch (const Error& error) {
    throw Error(error.what() + OfThePair(options, input, partner, error.what()));
  }
}

LightFieldScores ScoresOf(const CompareOptions& options, const ComparedInput& reference_input,
                          const ComparedInput& other_input, const RunControl& run) {
  const ComparedReadings readings =
      ReadingsOf(options.reading, options.other_reading, reference_input, other_input);
  const LightFieldReadOptions reference_reading = LightFieldReadOptionsOf(readings.reference);
  LightFieldReadOptions other_reading = LightFieldReadOptionsOf(readings.other);
  LightField reference =
      ReadCompared(options, reference_input, other_input, reference_reading, run);
  const Rect crop = std::exchange(other_reading.crop, std::nullopt);
  // Messages about the other input name the options that are for it alone.
  const OptionNames other_names = OtherReadingOptionNames();
  RunControl other_run = run;
  other_run.option_name = other_names;
  LightField other = WithOptionNames(other_names, [&] {
    return ReadCompared(options, other_input, reference_input, other_reading, other_run);
  });
  if (IsToCrop(crop, other.s_count, other.t_count))
    other = WithFileContext(options.other_path, [&] { return model::CropViews(other, *crop); });
  thicklens::CompareOptions asked;
  asked.border_px = options.border_px;
  if (!options.dibr_paths.empty()) {
    asked.baseline = ReadBaseline(options, crop, reference.camera.has_value());
  }
  return CompareLightFields(std::move(reference), std::move(other), std::move(asked), run);
}

CommandResult CompareTwoLightFields(const CompareOptions& options, const ComparedInput& reference,
                                    const ComparedInput& other) {
  const CommandRun run(options.common, CompareOptionNames());
  const LightFieldScores scores = WithOptionNames(
      run.names(), [&] { return ScoresOf(options, reference, other, run.control()); });
  PrintResult(options.common,
              LightFieldScoresText(scores, options.border_px, options.common.verbose));
  return {LightFieldScoresJson(scores, options.border_px), ""};
}

// Whether an input can only be a light field: a folder, or a file of arrays.
bool IsSurelyLightField(const ComparedInput& input) {
  if (input.is_folder) return true;
  const std::string layout = io::LayoutThatIsStated(input.path);
  return layout == "mat" || layout == "hdf5";
}

CommandResult Compare(const CompareOptions& options) {
  const ComparedInput reference = ComparedInputOf(options.reference_path);
  const ComparedInput other = ComparedInputOf(options.other_path);
  // Two image files are light fields only if the options say so.
  const bool is_stated = !options.reading.layout.empty() || !options.reading.name.empty() ||
                         !options.other_reading.layout.empty() ||
                         !options.other_reading.name.empty();
  const bool is_light_field =
      is_stated || IsSurelyLightField(reference) || IsSurelyLightField(other);
  return is_light_field ? CompareTwoLightFields(options, reference, other)
                        : CompareImageFiles(options);
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
  AddOtherReadingOptions(command, &options->other_reading);
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
