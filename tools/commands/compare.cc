// thicklens compare: compares an image or a light field with the true one.
#include "thicklens/estimator/compare.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/estimator/estimate_input.h"
#include "thicklens/io/aperture_statement.h"
#include "thicklens/io/depth_io.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/light_field_io.h"
#include "thicklens/model/encoded_values.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/light_field_options.h"
#include "tools/options/option_values.h"
#include "tools/options/with_file_context.h"
#include "tools/report/compare_table.h"

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

model::EncodedImage ReadImage(const std::string& path) {
  return io::ToEncodedImage(io::ReadImageFile(path));
}

model::EncodedImage Cropped(const model::EncodedImage& image, const Rect& crop,
                            const std::string& path) {
  if (!IsToCrop(crop, image.width_px, image.height_px)) return image;
  return WithFileContext(path, [&] { return model::CropImage(image, *crop); });
}

// ---- Two images.

CommandResult CompareImageFiles(const CompareOptions& options) {
  const io::LightFieldReading reading = ReadingOf(options.reading);
  if (reading.grid > 0 || reading.sparse || reading.u_count > 0 || !options.dibr_paths.empty()) {
    throw UsageError(
        fmt::format("--grid, --sparse, --views and --dibr are for light fields, but {} is an image",
                    PrintableUtf8(options.reference_path)));
  }
  model::EncodedImage reference = ReadImage(options.reference_path);
  if (reading.crop) {
    reference = WithFileContext(options.reference_path,
                                [&] { return model::CropImage(reference, *reading.crop); });
  }
  const model::EncodedImage other =
      Cropped(ReadImage(options.other_path), reading.crop, options.other_path);
  const estimator::ImageScores scores = WithFileContext(options.other_path, [&] {
    return estimator::CompareImages(model::EncodedValuesOf(reference),
                                    model::EncodedValuesOf(other), options.border_px);
  });
  PrintResult(options.common, ImageScoresText(scores, options.border_px));
  CommandResult result;
  result.summary = ImageScoresJson(scores);
  result.summary["status"] = "ok";
  result.summary["reason"] = "";
  result.summary["size"] = {reference.width_px, reference.height_px};
  result.summary["border_px"] = options.border_px;
  return result;
}

// ---- Two light fields.

// Takes the inner views of the larger light field, or of both if each is larger along one axis.
void TakeCommonViews(const CompareOptions& options, model::LightField* reference,
                     model::LightField* other) {
  const int u_count = std::min(reference->u_count, other->u_count);
  const int v_count = std::min(reference->v_count, other->v_count);
  const auto take = [&](model::LightField* light_field, const std::string& path) {
    if (light_field->u_count == u_count && light_field->v_count == v_count) return;
    const int all_u = light_field->u_count;
    const int all_v = light_field->v_count;
    *light_field =
        WithFileContext(path, [&] { return model::InnerViews(*light_field, u_count, v_count); });
    spdlog::warn("{}: the inner {}x{} of its {}x{} views are compared", PrintableUtf8(path),
                 u_count, v_count, all_u, all_v);
  };
  take(reference, options.reference_path);
  take(other, options.other_path);
}

model::LinearImage Photograph(const CompareOptions& options, const Rect& crop,
                              const model::LightField& reference) {
  const std::string& path = options.dibr_paths.front();
  model::EncodedImage stored = Cropped(ReadImage(path), crop, path);
  const int channels = stored.channels;
  if (channels == 1 && reference.channels == 3) {
    throw Error(fmt::format(
        "{}: a photograph in colour is expected because the views are in colour; it is grey",
        PrintableUtf8(path)));
  }
  model::LinearImage light = model::ToLinear(stored, reference.transfer);
  if (reference.channels == 1) return model::ToGrey(light);
  if (channels != 4) return light;
  model::LinearImage opaque{light.width_px, light.height_px, 3, {}};  // without alpha
  opaque.values.reserve(light.values.size() / 4 * 3);
  for (std::size_t i = 0; i < light.values.size(); ++i) {
    if (i % 4 != 3) opaque.values.push_back(light.values[i]);
  }
  return opaque;
}

std::optional<estimator::DibrInput> ReadDibr(const CompareOptions& options, const Rect& crop,
                                             const model::LightField& reference) {
  if (options.dibr_paths.empty()) return std::nullopt;
  const std::string& map_path = options.dibr_paths.back();
  DepthOptions depth = options.depth;
  // Without a camera the map can only hold disparities.
  if (depth.kind.empty() && !reference.camera) depth.kind = "disparity";
  estimator::DibrInput dibr;
  dibr.photograph = Photograph(options, crop, reference);
  if (dibr.photograph.width_px != reference.s_count ||
      dibr.photograph.height_px != reference.t_count) {
    throw Error(fmt::format("{}: it is {}x{} px, the views are {}x{} px: the sizes must be equal",
                            PrintableUtf8(options.dibr_paths.front()), dibr.photograph.width_px,
                            dibr.photograph.height_px, reference.s_count, reference.t_count));
  }
  // Views hold radiance, but a photograph does not: its fall-off would count as an error of the
  // warp.
  if (reference.camera && options.without.empty()) {
    dibr.photograph = estimator::WithoutFalloff(dibr.photograph, *reference.grid, *reference.camera,
                                                reference.weights, options.common.threads);
  }
  model::RawDepthMap map = io::ReadDepthMap(map_path);
  if (IsToCrop(crop, map.width_px, map.height_px))
    map = WithFileContext(map_path, [&] { return model::CropDepth(map, *crop); });
  PreparedDepth prepared = PrepareDepth(map, map_path, depth, dibr.photograph,
                                        reference.camera ? &*reference.camera : nullptr,
                                        reference.grid ? &*reference.grid : nullptr);
  if (prepared.holes > 0)
    spdlog::warn("{}: {} holes are filled from the surfaces beside them", PrintableUtf8(map_path),
                 prepared.holes);
  dibr.disparity = std::move(prepared.disparity);
  return dibr;
}

CommandResult CompareFolders(const CompareOptions& options) {
  io::LightFieldReading reading = ReadingOf(options.reading);
  model::LightField reference = io::ReadLightField(options.reference_path, reading);
  const Rect crop = std::exchange(reading.crop, std::nullopt);
  model::LightField other = io::ReadLightField(options.other_path, reading);
  if (IsToCrop(crop, other.s_count, other.t_count))
    other = WithFileContext(options.other_path, [&] { return model::CropViews(other, *crop); });
  if (const auto warning =
          io::DifferentApertures(options.reference_path, reference, options.other_path, other)) {
    spdlog::warn("{}", *warning);
  }
  TakeCommonViews(options, &reference, &other);
  const std::optional<estimator::DibrInput> dibr = ReadDibr(options, crop, reference);
  const estimator::LightFieldScores scores = WithFileContext(options.other_path, [&] {
    return estimator::CompareLightFields(reference, other, options.border_px, dibr,
                                         options.common.threads);
  });
  PrintResult(options.common,
              LightFieldScoresText(scores, reference, options.border_px, options.common.verbose));
  return {LightFieldScoresJson(scores, reference, options.border_px), ""};
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
  return is_folder ? CompareFolders(options) : CompareImageFiles(options);
}

// ---- The command line.

void AddDibrOptions(CLI::App* command, CompareOptions* options) {
  CLI::Option* dibr = command
                          ->add_option("--dibr", options->dibr_paths,
                                       "Also score depth-image-based rendering: this photograph "
                                       "warped to each view by its depth map")
                          ->expected(2)
                          ->type_name("PHOTO DEPTH");
  AddDepthOptions(command, &options->depth);
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
      ReadingOf(options->reading);  // reports wrong usage before any work begins
      std::vector<std::string> inputs = options->dibr_paths;
      inputs.insert(inputs.end(), {options->reference_path, options->other_path});
      RequireDistinctFiles({options->common.json_path}, inputs);
      RunCommand(options->common, [&] { return Compare(*options); });
    };
  });
}

}  // namespace thicklens::tools
