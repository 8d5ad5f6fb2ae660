// thicklens target: draws a calibration target to be printed at true scale.
#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/target_page.h"
#include "thicklens/model/target_texture.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/deprecated_names.h"
#include "tools/options/option_values.h"
#include "tools/report/target_drawing.h"

namespace thicklens::tools {
namespace {

constexpr double kShortestSideMm = 50;
constexpr double kLongestSideMm = 2000;
constexpr double kMaxFeatureMm = 50;
constexpr double kMaxDistanceMm = 1e6;
constexpr double kMinDpi = 72, kMaxDpi = 4800;
// In this range the pixels along both axes of the edge have many phases, and the plateaus stay
// wide.
constexpr double kMinEdgeDeg = 2, kMaxEdgeDeg = 20;

enum class Format { kPdf, kSvg, kPng };

struct NamedSheet {
  const char* name;
  double width_mm, height_mm;
};
constexpr std::array<NamedSheet, 3> kNamedSheets = {
    {{"a4", 210, 297}, {"a3", 297, 420}, {"letter", 215.9, 279.4}}};

struct TargetOptions {
  CommonOptions common;
  std::string output_path;
  std::string paper = "a4";
  std::string camera_path;
  double distance_mm = 0;
  double dots_per_inch = 600;
  std::optional<double> feature_mm;
  std::int64_t seed = 1;
  model::TargetRequest request;
};

Format FormatOf(const std::string& path) {
  const std::string ending = std::filesystem::path(path).extension().string();
  if (ending == ".pdf") return Format::kPdf;
  if (ending == ".svg") return Format::kSvg;
  if (ending == ".png") return Format::kPng;
  throw UsageError(fmt::format("{}: a name that ends in .pdf, .svg or .png is expected", path));
}

std::string LowerCase(std::string text) {
  for (char& letter : text) {
    if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
  }
  return text;
}

model::SheetSize ParseSheet(const std::string& text) {
  for (const NamedSheet& sheet : kNamedSheets) {
    if (LowerCase(text) == sheet.name) return {sheet.width_mm, sheet.height_mm, true};
  }
  const std::string form =
      fmt::format("a4, a3, letter or WxH in mm from {:g} to {:g}", kShortestSideMm, kLongestSideMm);
  const std::vector<double> sides_mm = SplitNumbers("--paper", text, 'x', form);
  const auto possible = [](double side_mm) {
    return side_mm >= kShortestSideMm && side_mm <= kLongestSideMm;
  };
  if (sides_mm.size() != 2 || !possible(sides_mm[0]) || !possible(sides_mm[1])) {
    throw UsageError(fmt::format("--paper: {} is expected, found '{}'", form, text));
  }
  return {sides_mm[0], sides_mm[1], false};
}

nlohmann::json RectangleJson(const model::SheetRectangle& area) {
  return {{"x_mm", area.x}, {"y_mm", area.y}, {"width_mm", area.width}, {"height_mm", area.height}};
}

nlohmann::json Summary(const TargetOptions& options, const model::TargetRequest& request,
                       const model::TargetPage& page, std::size_t leaves) {
  nlohmann::json summary = {{"status", "ok"},
                            {"reason", ""},
                            {"output", options.output_path},
                            {"sheet_width_mm", page.width_mm},
                            {"sheet_height_mm", page.height_mm},
                            {"pattern", RectangleJson(page.pattern)},
                            {"edge_patch", RectangleJson(page.patch)},
                            {"edge_angle_deg", page.edge_angle_deg},
                            {"bar", RectangleJson(page.bar)},
                            {"smallest_feature_mm", page.feature_mm},
                            {"smallest_feature_px", nullptr},
                            {"two_tone", page.two_tone},
                            {"seed", page.seed},
                            {"leaves", leaves},
                            {"caption", page.caption},
                            {"choice", page.choice}};
  if (request.view) {
    summary["smallest_feature_px"] = page.feature_mm / request.view->px_mm;
    summary["camera_view"] = {{"distance_mm", request.view->distance_mm},
                              {"width_mm", request.view->width_mm},
                              {"height_mm", request.view->height_mm},
                              {"mm_per_px", request.view->px_mm}};
  }
  return summary;
}

CommandResult MakeTarget(const TargetOptions& options, Format format,
                         model::TargetRequest request) {
  if (!options.camera_path.empty()) {
    const model::Camera camera = model::ReadCamera(options.camera_path);
    ReportAssumedFields(camera);
    const double focal_length_mm = camera.lens.front_focal_length_mm;
    if (!(options.distance_mm > focal_length_mm)) {
      throw Error(fmt::format(
          "--distance-mm {:g}: it must be above the front focal length {:g} mm of {}, because a "
          "nearer object has no real image",
          options.distance_mm, focal_length_mm, PrintableUtf8(options.camera_path)));
    }
    request.view = model::ViewOfTarget(camera, options.distance_mm);
  }
  const model::TargetPage page = model::LayOutTarget(request);
  std::optional<PngSize> png_size;
  if (format == Format::kPng) png_size = TargetPngSize(page, options.dots_per_inch);

  OutputFile output(options.output_path);
  const std::vector<model::TargetLeaf> leaves = model::DeadLeaves(page);
  const std::string bytes = format == Format::kPdf   ? TargetPdf(page, leaves)
                            : format == Format::kSvg ? TargetSvg(page, leaves)
                                                     : TargetPng(page, leaves, *png_size);
  ThrowIfCancelled();
  output.Commit(bytes);

  CommandResult result;
  result.is_written = true;
  result.summary = Summary(options, request, page, leaves.size());
  std::string size = fmt::format("sheet {:g} x {:g} mm", page.width_mm, page.height_mm);
  if (png_size) {
    result.summary["width_px"] = png_size->width_px;
    result.summary["height_px"] = png_size->height_px;
    result.summary["pixels_per_metre"] = png_size->pixels_per_metre;
    size += fmt::format(", {} x {} px", png_size->width_px, png_size->height_px);
  }
  PrintResult(options.common,
              fmt::format("{}: {}\n{}\nedge {:.1f} mm high, {:g} degrees from the vertical\nprint "
                          "at 100 %, without scaling; the bar must then measure {:.1f} mm\n",
                          options.output_path, size, page.choice, page.patch.height,
                          page.edge_angle_deg, page.bar.width));
  return result;
}

void AddTargetOptions(CLI::App* command, TargetOptions* options) {
  command->add_option("-o,--output", options->output_path, "File to write: .pdf, .svg or .png")
      ->required()
      ->type_name("FILE");
  command->add_option("--paper", options->paper, "Sheet: a4, a3, letter, or width x height in mm")
      ->capture_default_str()
      ->type_name("WxH");
  AddDeprecatedOptions(
      command, "--paper", [options](const std::string& text) { options->paper = text; },
      &options->common);
  CLI::Option* camera =
      command
          ->add_option("--camera", options->camera_path,
                       "Camera whose field the pattern must fill, with --distance-mm")
          ->type_name("CAMERA.yaml");
  CLI::Option* distance =
      command
          ->add_option("--distance-mm", options->distance_mm,
                       "Distance from the aperture of --camera to the target in focus")
          ->check(Between(0, kMaxDistanceMm, "mm from the aperture"))
          ->needs(camera)
          ->type_name("Z");
  camera->needs(distance);
  command
      ->add_option("--feature-mm", options->feature_mm, "Smallest feature; by default it is chosen")
      ->check(Between(0, kMaxFeatureMm, "mm on the sheet"))
      ->type_name("S");
  command
      ->add_option("--finest-mm", options->request.finest_mm,
                   "Smallest feature that the print method resolves")
      ->check(Between(0, kMaxFeatureMm, "mm on the sheet"))
      ->capture_default_str()
      ->type_name("S");
  command
      ->add_option("--edge-angle-deg", options->request.edge_angle_deg,
                   "Angle of the edge from the vertical, upper end to the right")
      ->check(Between(kMinEdgeDeg, kMaxEdgeDeg, "degrees from the vertical"))
      ->capture_default_str()
      ->type_name("A");
  command->add_flag("--two-tone", options->request.two_tone,
                    "Only black and white, for printers that print greys as dots");
  command->add_option("--dpi", options->dots_per_inch, "Resolution of a .png, dots per inch")
      ->check(Between(kMinDpi, kMaxDpi, "dots per inch"))
      ->capture_default_str()
      ->type_name("N");
  command->add_option("--seed", options->seed, "Seed of the texture")
      ->check(CLI::Range(std::int64_t{0}, std::numeric_limits<std::int64_t>::max()))
      ->capture_default_str()
      ->type_name("N");
  AddCommonOptions(command, &options->common);
}

}  // namespace

void AddTargetCommand(CLI::App* program, CommandAction* action) {
  CLI::App* command =
      program->add_subcommand("target", "Draw a calibration target to be printed at true scale");
  const auto options = std::make_shared<TargetOptions>();
  AddTargetOptions(command, options.get());
  command->callback([options, action] {
    *action = [options] {
      const Format format = FormatOf(options->output_path);
      model::TargetRequest request = options->request;
      request.sheet = ParseSheet(options->paper);
      request.feature_mm = options->feature_mm;
      request.seed = static_cast<std::uint64_t>(options->seed);
      RequireDistinctFiles({options->output_path, options->common.json_path},
                           {options->camera_path});
      RunCommand(options->common, [&] { return MakeTarget(*options, format, request); });
    };
  });
}

}  // namespace thicklens::tools
