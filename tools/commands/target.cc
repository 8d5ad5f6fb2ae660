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
constexpr double kDefaultSquareMm = 10;
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
  std::string pattern = "texture";
  std::string squares;  // COLUMNSxROWS; empty: as many as fit
  std::optional<double> square_mm;
  std::optional<double> marker_mm;
  std::string dictionary;
  bool no_marks = false;
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

// The grid that was asked for; its number of squares is 0 where it is chosen. Absent: a texture.
std::optional<model::TargetGrid> GridOf(const TargetOptions& options) {
  const bool is_texture = options.pattern == "texture";
  const bool is_charuco = options.pattern == "charuco";
  const auto only = [](bool is_given, bool may_be, const char* option, const char* pattern) {
    if (is_given && !may_be)
      throw UsageError(fmt::format("{} is for --pattern {}", option, pattern));
  };
  only(!options.squares.empty(), !is_texture, "--squares", "chequerboard, charuco or circles");
  only(options.square_mm.has_value(), !is_texture, "--square-mm",
       "chequerboard, charuco or circles");
  only(options.marker_mm.has_value(), is_charuco, "--marker-mm", "charuco");
  only(!options.dictionary.empty(), is_charuco, "--dictionary", "charuco");
  only(options.feature_mm.has_value(), is_texture, "--feature-mm", "texture");
  only(options.no_marks, is_texture, "--no-marks", "texture");
  if (is_texture) return std::nullopt;
  model::TargetGrid grid;
  grid.pattern = *model::GridPatternOf(options.pattern);
  grid.square_mm = options.square_mm.value_or(kDefaultSquareMm);
  if (!options.squares.empty()) {
    const auto counts = SplitPixels("--squares", options.squares, 'x', "COLUMNSxROWS");
    if (counts.size() != 2 || counts[0] < 1 || counts[1] < 1) {
      throw UsageError(fmt::format("--squares: COLUMNSxROWS, such as 11x8, is expected, found '{}'",
                                   options.squares));
    }
    grid.columns = counts[0];
    grid.rows = counts[1];
  }
  if (is_charuco) {
    grid.marker_mm = options.marker_mm.value_or(model::kMarkerPart * grid.square_mm);
    if (!options.dictionary.empty()) grid.dictionary = LowerCase(options.dictionary);
    constexpr char kPrefix[] = "dict_";
    if (grid.dictionary.rfind(kPrefix, 0) == 0) grid.dictionary.erase(0, sizeof(kPrefix) - 1);
  }
  return grid;
}

nlohmann::json TargetGridJson(const std::optional<model::TargetGrid>& grid) {
  if (!grid) return nullptr;
  const bool is_charuco = grid->pattern == model::GridPattern::kCharuco;
  return {{"pattern", model::GridPatternName(grid->pattern)},
          {"columns", grid->columns},
          {"rows", grid->rows},
          {"square_mm", grid->square_mm},
          {"marker_mm", is_charuco ? nlohmann::json(grid->marker_mm) : nlohmann::json()},
          {"dictionary", is_charuco ? nlohmann::json(grid->dictionary) : nlohmann::json()}};
}

nlohmann::json RectangleJson(const model::SheetRectangle& area) {
  return {{"x_mm", area.x}, {"y_mm", area.y}, {"width_mm", area.width}, {"height_mm", area.height}};
}

nlohmann::json PlacedMarksJson(const std::vector<model::PlacedMark>& marks) {
  nlohmann::json rows = nlohmann::json::array();
  for (const model::PlacedMark& mark : marks) {
    rows.push_back({{"dictionary", model::kSheetDictionary},
                    {"number", mark.number},
                    {"area", RectangleJson(mark.area)}});
  }
  return rows;
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
                            {"grid", TargetGridJson(page.grid)},
                            {"marks", PlacedMarksJson(page.marks)},
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
  const std::vector<model::TargetLeaf> leaves =
      page.grid ? std::vector<model::TargetLeaf>() : model::DeadLeaves(page);
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
  std::string facts;
  if (page.grid) {
    facts = "state it to calibrate by: " + page.caption[1];
  } else {
    facts = fmt::format("edge {:.1f} mm high, {:g} degrees from the vertical", page.patch.height,
                        page.edge_angle_deg);
    if (!page.marks.empty()) facts += "\n" + page.caption.back();
  }
  PrintResult(options.common,
              fmt::format("{}: {}\n{}\n{}\nprint at 100 %, without scaling; the bar must then "
                          "measure {:.1f} mm\n",
                          options.output_path, size, page.choice, facts, page.bar.width));
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
  command
      ->add_option("--pattern", options->pattern,
                   "texture, or a grid, by which calibrate finds the distortion of the lens: "
                   "chequerboard (or checkerboard), charuco or circles")
      ->check(CLI::IsMember(
          {"texture", "chequerboard", "checkerboard", "chessboard", "charuco", "circles"}))
      ->capture_default_str()
      ->type_name("NAME");
  command
      ->add_option("--squares", options->squares,
                   "Numbers of squares (or circles) of a grid along x and y; default: as many as "
                   "fit the sheet or, with --camera, nine tenths of the field")
      ->type_name("COLUMNSxROWS");
  command
      ->add_option("--square-mm", options->square_mm,
                   fmt::format("Side of a square of a grid, or distance of the circles' centres; "
                               "default {:g}",
                               kDefaultSquareMm))
      ->check(Between(0, kMaxFeatureMm * 10, "mm on the sheet"))
      ->type_name("MM");
  command
      ->add_option("--marker-mm", options->marker_mm,
                   "Side of a marker of a ChArUco board; default 0.7 of --square-mm")
      ->check(Between(0, kMaxFeatureMm * 10, "mm on the sheet"))
      ->type_name("MM");
  command
      ->add_option("--dictionary", options->dictionary,
                   "Dictionary of a ChArUco board, as OpenCV names it; default 4x4_250")
      ->type_name("NAME");
  command->add_flag("--no-marks", options->no_marks,
                    "Leave out the marks at the corners of a texture, which state its scale");
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
      request.grid = GridOf(*options);
      request.has_marks = !options->no_marks;
      request.seed = static_cast<std::uint64_t>(options->seed);
      RequireDistinctFiles({options->output_path, options->common.json_path},
                           {options->camera_path});
      RunCommand(options->common, [&] { return MakeTarget(*options, format, request); });
    };
  });
}

}  // namespace thicklens::tools
