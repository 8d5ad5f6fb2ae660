#include "tools/options/sweep_input.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>

#include "thicklens/io/video_file.h"
#include "tools/options/distortion_option.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

constexpr char kSweepName[] = "sweep.yaml";
constexpr char kUnknown[] = "unknown";

void TakeOffset(const SweepArguments& arguments, SweepOverrides* overrides) {
  overrides->offset_sigma_mm = arguments.offset_sigma_mm;
  overrides->offset_unknown = arguments.offset_mm == kUnknown;
  if (arguments.offset_mm.empty() || overrides->offset_unknown) return;
  const auto numbers =
      SplitNumbers("--offset-mm", arguments.offset_mm, ':', "a number or 'unknown'");
  if (numbers.size() != 1) {
    throw UsageError(fmt::format("--offset-mm: a number or 'unknown' is expected, found '{}'",
                                 arguments.offset_mm));
  }
  overrides->offset_mm = numbers[0];
}

void TakeFloor(const SweepArguments& arguments, SweepOverrides* overrides) {
  const std::string& text = arguments.floor_px;
  if (!arguments.floor_from.empty() && !text.empty())
    throw UsageError("--floor-from and --floor-px exclude each other");
  overrides->floor_from_calibration = arguments.floor_from;
  overrides->floor_unknown = text == kUnknown;
  if (text.empty() || overrides->floor_unknown) return;
  const std::string form = "VALUE, VALUE:SIGMA or 'unknown'";
  const auto numbers = SplitNumbers("--floor-px", text, ':', form);
  const bool in_range = numbers[0] >= 0 && (numbers.size() < 2 || numbers[1] >= 0);
  if (numbers.size() > 2 || !in_range) {
    throw UsageError(fmt::format("--floor-px: {} is expected, >= 0, found '{}'", form, text));
  }
  overrides->floor_px = Measured{numbers[0], numbers.size() > 1 ? numbers[1] : 0};
}

// Returns a statement about the plane of focus; absent if it was not given.
std::optional<Measured> FocusStatement(const std::string& option, const std::string& text) {
  if (text.empty()) return std::nullopt;
  const std::string form = "VALUE or VALUE:SIGMA";
  const auto numbers = SplitNumbers(option, text, ':', form);
  const bool in_range = numbers[0] > 0 && (numbers.size() < 2 || numbers[1] >= 0);
  if (numbers.size() > 2 || !in_range) {
    throw UsageError(fmt::format("{}: {} with VALUE > 0 and SIGMA >= 0 is expected, found '{}'",
                                 option, form, text));
  }
  return Measured{numbers[0], numbers.size() > 1 ? numbers[1] : 0};
}

void TakeFocus(const SweepArguments& arguments, SweepOverrides* overrides) {
  overrides->focus_depth_mm = FocusStatement("--focus-depth-mm", arguments.focus_depth_mm);
  overrides->working_distance_mm =
      FocusStatement("--working-distance-mm", arguments.working_distance_mm);
  overrides->image_distance_mm = FocusStatement("--image-distance-mm", arguments.image_distance_mm);
  overrides->optical_tube_length_mm = FocusStatement("--tube-length-mm", arguments.tube_length_mm);
  overrides->magnification = FocusStatement("--magnification", arguments.magnification);
  overrides->target_period_mm = arguments.target_period_mm;
  if (!arguments.target_grid.empty()) {
    try {
      overrides->target_grid = model::ParseTargetGrid(arguments.target_grid);
    } catch (const Error& error) {
      throw UsageError(std::string("--grid: ") + error.what());
    }
  }
  overrides->grid_views = arguments.grid_views;
  overrides->stage_alignment_deg = arguments.stage_alignment_deg;
}

void TakeRoi(const std::string& text, SweepOverrides* overrides) {
  if (text.empty()) return;
  const auto px = SplitPixels("--roi", text, ',', "x,y,width,height");
  if (px.size() != 4 || px[2] < 1 || px[3] < 1) {
    throw UsageError(fmt::format(
        "--roi: x,y,width,height with width and height above 0 are expected, found '{}'", text));
  }
  overrides->roi = model::RegionOfInterest{px[0], px[1], px[2], px[3]};
}

bool HasSweepFile(const SweepArguments& arguments) {
  std::error_code failure;
  return fs::exists(fs::path(arguments.input) / kSweepName, failure);
}

// Whether the input is an image: its pages are the frames.
bool IsStack(const SweepArguments& arguments) {
  std::error_code failure;
  return model::IsNameOfImage(arguments.input) && fs::is_regular_file(arguments.input, failure);
}

// Whether the input is a video, by its name or by its content.
bool IsVideo(const SweepArguments& arguments) {
  std::error_code failure;
  return fs::is_regular_file(arguments.input, failure) &&
         (io::IsNameOfVideo(arguments.input) || io::IsVideoFile(arguments.input));
}

// A video needs a table or a constant speed; other inputs have neither times nor speeds.
void CheckVideo(const SweepArguments& arguments) {
  const bool has_speed = arguments.video.reading_start || arguments.video.reading_end;
  if (arguments.readings.IsWithoutTable()) {
    throw UsageError(fmt::format(
        "{}: the frames of a video have one name and one set of metadata; their readings come from "
        "--readings, or from --reading-start and --reading-end",
        arguments.input));
  }
  if (arguments.readings_csv.empty() == has_speed) return;
  throw UsageError(
      has_speed ? std::string("--readings (a table) and --reading-start (a constant speed) exclude "
                              "each other")
                : fmt::format("{}: a video needs --readings (a table of its readings by time or by "
                              "frame), or --reading-start and --reading-end for a constant speed",
                              arguments.input));
}

// Throws UsageError unless the input is a sweep's file, a folder with one, or a folder with a table
// of readings.
void CheckInput(const SweepArguments& arguments) {
  std::error_code failure;
  if (IsVideo(arguments)) {
    CheckVideo(arguments);
    return;
  }
  const bool is_folder = fs::is_directory(arguments.input, failure);
  if (!arguments.readings_csv.empty()) {
    if (arguments.readings.IsWithoutTable()) {
      throw UsageError(
          "--readings (a table) and --reading-from or --reading-from-name (the files themselves) "
          "exclude each other");
    }
    if (is_folder || IsStack(arguments)) return;
    throw UsageError(
        fmt::format("--readings requires a folder of frames; {} is not a folder", arguments.input));
  }
  if (!is_folder || HasSweepFile(arguments)) return;
  if (arguments.readings.IsWithoutTable()) return;
  const std::vector<std::string> images = model::ImagesOfFolder(arguments.input);
  const auto pattern = model::ProposedNamePattern(images);
  throw UsageError(fmt::format(
      "{}: a folder without {} needs --readings (a table of file and reading) and --camera{}{}",
      arguments.input, kSweepName,
      images.size() == 1
          ? fmt::format("; if its pages are the frames and have positions (OME-TIFF), give the "
                        "file itself: {}",
                        images.front())
          : "",
      pattern ? fmt::format("; if the one number that changes in the names is the reading: "
                            "--reading-from-name '{}' (--unit states its unit)",
                            *pattern)
              : ""));
}

}  // namespace

std::vector<std::string> SweepArguments::Files() const {
  std::vector<std::string> files = {input,      readings_csv, camera_path,
                                    truth_path, floor_from,   grid_views};
  for (const auto* more : {&correction.dark, &correction.flat, &correction.defects})
    files.insert(files.end(), more->begin(), more->end());
  files.push_back(FileOfDistortion(distortion));
  return files;
}

// Direction, moving part and target were checked against their lists of names when the command line
// was read.
SweepOverrides SweepOverridesOf(const SweepArguments& arguments) {
  SweepOverrides overrides;
  overrides.camera_path = arguments.camera_path;
  overrides.truth_path = arguments.truth_path;
  TakeOffset(arguments, &overrides);
  TakeFocus(arguments, &overrides);
  TakeFloor(arguments, &overrides);
  TakeRoi(arguments.roi, &overrides);
  overrides.reading_sigma_mm = arguments.reading_sigma_mm;
  overrides.full_scale = arguments.full_scale;
  for (const auto raw : {model::SweepRaw::kDemosaiced, model::SweepRaw::kGreen}) {
    if (arguments.raw == model::SweepRawName(raw)) overrides.raw = raw;
  }
  overrides.correction = arguments.correction;
  overrides.distortion = arguments.distortion;
  overrides.readings = arguments.readings;
  overrides.video = arguments.video;
  for (const auto direction : {model::BenchDirection::kAway, model::BenchDirection::kToward}) {
    if (arguments.direction == model::BenchDirectionName(direction)) {
      overrides.direction = direction;
    }
  }
  for (const auto part : {model::SweepMotion::kTarget, model::SweepMotion::kCamera,
                          model::SweepMotion::kLens, model::SweepMotion::kSensor}) {
    if (arguments.moves == model::SweepMotionName(part)) overrides.moves = part;
  }
  for (const auto target :
       {model::SweepTarget::kAuto, model::SweepTarget::kTexture, model::SweepTarget::kPrintedEdge,
        model::SweepTarget::kKnifeEdge, model::SweepTarget::kPoints}) {
    if (arguments.target == model::SweepTargetName(target)) overrides.target = target;
  }
  return overrides;
}

OptionNames SweepOptionNames() {
  return {{"camera_path", "--camera"},
          {"truth_path", "--truth"},
          {"offset_mm", "--offset-mm"},
          {"offset_sigma_mm", "--offset-sigma-mm"},
          {"focus_depth_mm", "--focus-depth-mm"},
          {"working_distance_mm", "--working-distance-mm"},
          {"image_distance_mm", "--image-distance-mm"},
          {"optical_tube_length_mm", "--tube-length-mm"},
          {"magnification", "--magnification"},
          {"target_period_mm", "--target-period-mm"},
          {"target_grid", "--grid"},
          {"grid_views", "--grid-views"},
          {"stage_alignment_deg", "--stage-alignment-deg"},
          {"direction", "--direction"},
          {"moves", "--moves"},
          {"reading_sigma_mm", "--reading-sigma-mm"},
          {"floor_px", "--floor-px"},
          {"floor_from_calibration", "--floor-from"},
          {"target", "--target"},
          {"roi", "--roi"},
          {"full_scale", "--full-scale"},
          {"raw", "--raw"},
          {"correction.dark", "--dark"},
          {"correction.flat", "--flat"},
          {"correction.defects", "--defects"},
          {"distortion", "--distortion"},
          {"readings", "--readings"},
          {"readings.column", "--column"},
          {"readings.file_column", "--file-column"},
          {"readings.unit", "--unit"},
          {"readings.scale_mm", "--reading-scale"},
          {"readings.decimal", "--decimal"},
          {"readings.source", "--reading-from"},
          {"readings.name_pattern", "--reading-from-name"},
          {"readings.time_column", "--time-column"},
          {"readings.time_unit", "--time-unit"},
          {"video.reading_start", "--reading-start"},
          {"video.reading_end", "--reading-end"},
          {"video.time_start_s", "--time-start"},
          {"video.time_end_s", "--time-end"},
          {"video.time_offset", "--time-offset"},
          {"video.every", "--every"},
          {"video.frames", "--frames"},
          {"video", "--reading-start, --time-start, --every and the like"}};
}

Sweep ReadSweepInput(const SweepArguments& arguments, const RunControl& run) {
  CheckInput(arguments);
  const SweepOverrides overrides = SweepOverridesOf(arguments);
  const OptionNames names = SweepOptionNames();
  RunControl named = run;
  if (!named.option_name) named.option_name = names;
  return WithOptionNames(names, [&] {
    std::error_code failure;
    const bool is_plain_folder =
        !arguments.readings_csv.empty() || IsStack(arguments) || IsVideo(arguments) ||
        (fs::is_directory(arguments.input, failure) && !HasSweepFile(arguments));
    return is_plain_folder
               ? ReadSweepFolder(arguments.input, arguments.readings_csv, overrides, named)
               : ReadSweep(arguments.input, overrides, named);
  });
}

}  // namespace thicklens::tools
