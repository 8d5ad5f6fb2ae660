#include "tools/options/sweep_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <filesystem>
#include <system_error>
#include <utility>

#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/model/camera_file.h"
#include "tools/interface/missing_tolerances.h"
#include "tools/options/option_values.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

constexpr char kSweepName[] = "sweep.yaml";
constexpr char kTruthName[] = "truth.yaml";
constexpr char kUnknown[] = "unknown";

// Returns the file that describes the sweep; empty for a folder with a table of readings.
std::string SweepYamlOf(const SweepArguments& arguments) {
  std::error_code failure;
  if (!fs::is_directory(arguments.input, failure)) {
    if (!arguments.readings_csv.empty()) {
      throw UsageError(fmt::format("--readings requires a folder of frames; {} is not a folder",
                                   arguments.input));
    }
    return arguments.input;
  }
  if (!arguments.readings_csv.empty()) return "";
  const fs::path inside = fs::path(arguments.input) / kSweepName;
  if (fs::exists(inside, failure)) return inside.string();
  throw UsageError(fmt::format(
      "{}: a folder without {} needs --readings (a table of file and reading) and --camera",
      arguments.input, kSweepName));
}

model::SweepFile ReadFile(const SweepArguments& arguments, std::vector<std::string>* notices) {
  const std::string yaml = SweepYamlOf(arguments);
  if (!yaml.empty()) {
    model::SweepFile file = model::ReadSweep(yaml, notices);
    if (!arguments.camera_path.empty()) file.camera_path = arguments.camera_path;
    return file;
  }
  if (arguments.camera_path.empty()) {
    throw UsageError(
        fmt::format("{}: a folder with --readings also needs --camera (see thicklens "
                    "camera init)",
                    arguments.input));
  }
  return model::SweepFromFolder(arguments.input, arguments.readings_csv, arguments.camera_path,
                                notices);
}

void TakeOffset(const SweepArguments& arguments, model::SweepFile* file) {
  if (arguments.offset_mm == kUnknown) {
    if (arguments.offset_sigma_mm)
      throw UsageError("--offset-sigma-mm: an unknown offset has no standard deviation");
    file->offset_mm.reset();
    return;
  }
  if (!arguments.offset_mm.empty()) {
    const auto numbers =
        SplitNumbers("--offset-mm", arguments.offset_mm, ':', "a number or 'unknown'");
    if (numbers.size() != 1) {
      throw UsageError(fmt::format("--offset-mm: a number or 'unknown' is expected, found '{}'",
                                   arguments.offset_mm));
    }
    file->offset_mm = model::Estimate{numbers[0], 0};
  }
  if (!arguments.offset_sigma_mm) return;
  if (!file->offset_mm)
    throw UsageError("--offset-sigma-mm: the offset itself is missing, give --offset-mm");
  file->offset_mm->sigma = *arguments.offset_sigma_mm;
}

void TakeFloor(const SweepArguments& arguments, model::SweepFile* file) {
  const std::string& text = arguments.floor_px;
  if (!arguments.floor_from.empty()) {
    if (!text.empty()) throw UsageError("--floor-from and --floor-px exclude each other");
    model::TakeFloorOfCalibration(arguments.floor_from, "--floor-from: ", file);
    return;
  }
  if (text.empty()) return;
  file->floor = {};
  file->floor_origin.reset();
  if (text == kUnknown) return;
  const std::string form = "VALUE, VALUE:SIGMA or 'unknown'";
  const auto numbers = SplitNumbers("--floor-px", text, ':', form);
  const bool in_range = numbers[0] >= 0 && (numbers.size() < 2 || numbers[1] >= 0);
  if (numbers.size() > 2 || !in_range) {
    throw UsageError(fmt::format("--floor-px: {} is expected, >= 0, found '{}'", form, text));
  }
  file->floor.given_px = model::Estimate{numbers[0], numbers.size() > 1 ? numbers[1] : 0};
}

void TakeRoi(const std::string& text, model::SweepFile* file) {
  if (text.empty()) return;
  const auto px = SplitPixels("--roi", text, ',', "x,y,width,height");
  if (px.size() != 4 || px[2] < 1 || px[3] < 1) {
    throw UsageError(fmt::format(
        "--roi: x,y,width,height with width and height above 0 are expected, found '{}'", text));
  }
  file->roi = {px[0], px[1], px[2], px[3]};
}

// Direction and target were checked against their lists of names when the command line was read.
void TakeArguments(const SweepArguments& arguments, model::SweepFile* file) {
  TakeOffset(arguments, file);
  TakeFloor(arguments, file);
  TakeRoi(arguments.roi, file);
  if (arguments.reading_sigma_mm) {
    file->reading_sigma_mm = *arguments.reading_sigma_mm;
    file->reading_sigma_stated = true;
  }
  for (const auto direction : {model::BenchDirection::kAway, model::BenchDirection::kToward}) {
    if (arguments.direction == model::BenchDirectionName(direction)) file->direction = direction;
  }
  for (const auto target : {model::SweepTarget::kAuto, model::SweepTarget::kTexture,
                            model::SweepTarget::kPrintedEdge, model::SweepTarget::kKnifeEdge}) {
    if (arguments.target == model::SweepTargetName(target)) file->target = target;
  }
}

bool IsJpeg(const std::string& path) {
  std::string ending = fs::path(path).extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return ending == ".jpg" || ending == ".jpeg";
}

// Compression removes fine detail, which looks like blur, and a fit of the frames alone cannot
// separate the two: on a simulated sweep with 1 px of blur, quality 90 changes kappa by 1 %.
void NoteCompression(const std::vector<model::SweepFrame>& frames,
                     std::vector<std::string>* notices) {
  const auto jpegs = std::count_if(frames.begin(), frames.end(),
                                   [](const auto& frame) { return IsJpeg(frame.image); });
  if (jpegs == 0) return;
  notices->push_back(
      fmt::format("{} of {} frames are JPEG files: compression removes fine detail as blur does, "
                  "and the stated errors do not include its effect on zf and kappa (about 1 % of "
                  "kappa at quality 90 and 1 px of blur); use PNG or TIFF if 1 % matters",
                  jpegs, frames.size()));
}

// A file that merely happens to be called truth.yaml must not stop a calibration.
std::optional<model::SweepTruth> ReadTruth(const SweepArguments& arguments,
                                           const std::string& sweep_yaml,
                                           std::vector<std::string>* notices) {
  if (!arguments.truth_path.empty()) return model::ReadSweepTruth(arguments.truth_path);
  if (sweep_yaml.empty()) return std::nullopt;
  const fs::path beside = fs::path(sweep_yaml).parent_path() / kTruthName;
  std::error_code failure;
  if (!fs::is_regular_file(beside, failure)) return std::nullopt;
  // The file is reported even if it is not used: it belongs to the sweep.
  ReportInput(beside.string());
  try {
    return model::ReadSweepTruth(beside.string());
  } catch (const Error& error) {
    notices->push_back(fmt::format("not used as the truth: {}", error.what()));
    return std::nullopt;
  }
}

}  // namespace

std::vector<std::string> SweepArguments::Files() const {
  return {input, readings_csv, camera_path, truth_path, floor_from};
}

SweepInput ReadSweepInput(const SweepArguments& arguments) {
  SweepInput input;
  input.file = ReadFile(arguments, &input.notices);
  TakeArguments(arguments, &input.file);
  // The file does not state it, but the command line does.
  if (input.file.reading_sigma_stated) {
    input.notices.erase(std::remove_if(input.notices.begin(), input.notices.end(),
                                       [](const std::string& notice) {
                                         return notice.rfind("reading_sigma_mm is not stated", 0) ==
                                                0;
                                       }),
                        input.notices.end());
  }
  NoteCompression(input.file.frames, &input.notices);
  input.truth = ReadTruth(arguments, SweepYamlOf(arguments), &input.notices);
  input.sweep = calib::MakeFocusSweep(input.file, model::ReadCamera(input.file.camera_path));
  if (!input.truth) {  // the parameters of a simulated camera are exact
    const std::string missing = MissingTolerancesLine(input.sweep.camera);
    if (!missing.empty()) input.notices.push_back(missing);
  }
  input.frame_files = std::make_shared<io::FrameFiles>(input.file.frames);
  input.sweep.read_frame = [files = input.frame_files](std::size_t i) { return files->Read(i); };
  return input;
}

}  // namespace thicklens::tools
