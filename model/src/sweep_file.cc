#include "thicklens/model/sweep_file.h"

#include <fmt/format.h>
#include <glob.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <set>
#include <system_error>

#include "readings_table.h"
#include "thicklens/error.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/yaml_reader.h"

namespace thicklens::model {
namespace {

namespace fs = std::filesystem;

constexpr char kSchema[] = "thicklens/sweep/1";
constexpr char kTruthSchema[] = "thicklens/sweep-truth/1";

double MillimetresPer(const std::string& unit) {
  if (unit == "um") return 1e-3;
  if (unit == "cm") return 10;
  if (unit == "m") return 1000;
  if (unit == "in") return 25.4;
  return 1;
}

// Half-written outputs and what some systems lay beside every file ("._frame.png").
bool IsHidden(const fs::path& file) { return file.filename().string().rfind('.', 0) == 0; }

bool IsPictureName(const fs::path& file) {
  static const std::set<std::string> kEndings = {".png", ".jpg", ".jpeg", ".tif", ".tiff",
                                                 ".bmp", ".pgm", ".ppm",  ".pnm"};
  std::string ending = file.extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return kEndings.count(ending) > 0;
}

// The folder of the YAML file may have any name: only what stands in the file is a pattern.
std::string EscapedForGlob(const std::string& folder) {
  std::string escaped;
  for (const char c : folder) {
    if (c == '*' || c == '?' || c == '[' || c == '\\') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

std::vector<std::string> FilesMatching(const YamlNode& node) {
  const std::string folder = EscapedForGlob(fs::path(node.source()).parent_path().string());
  const std::string pattern = (fs::path(folder) / node.Text()).string();
  glob_t found{};
  std::vector<std::string> files;
  if (::glob(pattern.c_str(), 0, nullptr, &found) == 0) {
    for (std::size_t i = 0; i < found.gl_pathc; ++i) files.emplace_back(found.gl_pathv[i]);
  }
  ::globfree(&found);
  return files;
}

// Pictures directly in the folder, or, where it has none, in its own sub-folders: a person points
// at the folder that holds both the table and "frames/".
std::vector<std::string> PicturesIn(const std::string& folder) {
  std::error_code failure;
  if (!fs::is_directory(folder, failure)) throw Error(fmt::format("{}: no such folder", folder));
  fs::directory_iterator entries(folder, failure);
  if (failure) throw Error(fmt::format("{}: cannot be read: {}", folder, failure.message()));
  std::vector<std::string> here, below;
  for (const auto& entry : entries) {
    if (IsHidden(entry.path())) continue;
    if (entry.is_regular_file(failure) && IsPictureName(entry.path()))
      here.push_back(entry.path().string());
    if (!entry.is_directory(failure)) continue;
    for (const auto& inner : fs::directory_iterator(entry.path(), failure)) {
      if (!IsHidden(inner.path()) && inner.is_regular_file(failure) && IsPictureName(inner.path()))
        below.push_back(inner.path().string());
    }
  }
  std::vector<std::string>& files = here.empty() ? below : here;
  std::sort(files.begin(), files.end());
  return files;
}

// Brings table rows and picture files together by name; each must have its partner.
std::vector<SweepFrame> JoinRowsAndFiles(const std::vector<ReadingRow>& rows,
                                         const std::string& table,
                                         const std::vector<std::string>& files,
                                         const std::string& folder, double mm_per_unit) {
  std::vector<SweepFrame> frames;
  std::set<std::string> used;
  for (const ReadingRow& row : rows) {
    std::string path = (fs::path(folder) / row.file).lexically_normal().string();
    std::error_code failure;
    if (!fs::is_regular_file(path, failure)) {
      const auto same_name = [&](const std::string& file) {
        return fs::path(file).filename() == row.file;
      };
      const auto match = std::find_if(files.begin(), files.end(), same_name);
      if (match == files.end()) {
        throw Error(fmt::format("{}:{}: the file '{}' is not in {}", table, row.line, row.file,
                                folder.empty() ? "." : folder));
      }
      const auto other = std::find_if(match + 1, files.end(), same_name);
      if (other != files.end()) {
        throw Error(fmt::format("{}:{}: '{}' may be {} or {}; name its folder too", table, row.line,
                                row.file, *match, *other));
      }
      path = fs::path(*match).lexically_normal().string();
    }
    if (!used.insert(path).second) {
      throw Error(
          fmt::format("{}:{}: the file '{}' has a reading already", table, row.line, row.file));
    }
    frames.push_back({path, row.reading * mm_per_unit});
  }
  std::vector<std::string> without_row;
  for (const std::string& file : files) {
    if (used.count(fs::path(file).lexically_normal().string()) == 0) without_row.push_back(file);
  }
  // A picture that was left out by mistake costs more than one that has to be moved away.
  if (!without_row.empty()) {
    throw Error(fmt::format(
        "{}: has no row in {} ({} such file{}): add its reading, move it elsewhere, or "
        "choose the files by frames_glob",
        without_row.front(), table, without_row.size(), without_row.size() == 1 ? "" : "s"));
  }
  return frames;
}

bool IsUnknown(const YamlNode& node) { return node.IsScalar() && node.Text() == "unknown"; }

void ReadOffset(const YamlNode& root, SweepFile* sweep) {
  const auto node = root.Find("offset_mm");
  if (!node) return;
  if (node->IsMap()) {
    node->RequireKeys({"value", "sigma"});
    Estimate offset{node->At("value").Number(), 0};
    if (const auto sigma = node->Find("sigma")) offset.sigma = sigma->NonNegativeNumber();
    sweep->offset_mm = offset;
  } else if (!IsUnknown(*node)) {
    sweep->offset_mm = Estimate{node->Number(), 0};
  }
}

void ReadFloor(const YamlNode& root, SweepFile* sweep) {
  const auto node = root.Find("blur_floor_px");
  if (!node) return;
  if (!node->IsMap()) {
    if (!IsUnknown(*node)) sweep->floor.given_px = Estimate{node->NonNegativeNumber(), 0};
    return;
  }
  node->RequireKeys({"value", "sigma", "from", "to", "from_calibration"});
  const bool is_interval = node->Has("from") || node->Has("to");
  const bool is_value = node->Has("value") || node->Has("sigma");
  const auto file = node->Find("from_calibration");
  if (is_interval + is_value + file.has_value() != 1) {
    throw node->ErrorHere(
        "one of {value, sigma}, {from, to} and {from_calibration} is expected, not a mixture");
  }
  if (file) {
    const std::string place = file->ErrorHere("").what();
    TakeFloorOfCalibration(file->ResolvePath(file->Text()), place, sweep);
  } else if (is_interval) {
    sweep->floor.from_px = node->At("from").NonNegativeNumber();
    sweep->floor.to_px = node->At("to").NonNegativeNumber();
    if (!(*sweep->floor.from_px <= *sweep->floor.to_px)) {
      throw node->ErrorHere(fmt::format("'from' must be <= 'to', found {} and {}",
                                        *sweep->floor.from_px, *sweep->floor.to_px));
    }
  } else {
    Estimate floor{node->At("value").NonNegativeNumber(), 0};
    if (const auto sigma = node->Find("sigma")) floor.sigma = sigma->NonNegativeNumber();
    sweep->floor.given_px = floor;
  }
}

void ReadFrames(const YamlNode& root, double mm_per_unit, SweepFile* sweep) {
  if (root.Has("frames") == root.Has("frames_csv")) {
    throw root.ErrorHere(
        "either 'frames' (a list of image and reading_mm) or 'frames_csv' (a table) is expected");
  }
  if (const auto table = root.Find("frames_csv")) {
    const std::string csv = table->ResolvePath(table->Text());
    std::string folder = fs::path(csv).parent_path().string();
    if (const auto dir = root.Find("frames_dir")) folder = dir->ResolvePath(dir->Text());
    std::vector<std::string> files;
    if (const auto pattern = root.Find("frames_glob")) {
      files = FilesMatching(*pattern);
      if (files.empty())
        throw pattern->ErrorHere(fmt::format("no file matches '{}'", pattern->Text()));
    } else {
      files = PicturesIn(folder.empty() ? "." : folder);
    }
    sweep->frames = JoinRowsAndFiles(ReadReadingsTable(csv), csv, files, folder, mm_per_unit);
    return;
  }
  for (const char* key : {"frames_dir", "frames_glob"}) {
    if (const auto extra = root.Find(key))
      throw extra->ErrorHere("goes with 'frames_csv'; the paths in 'frames' are complete");
  }
  std::set<std::string> images;
  for (const YamlNode& node : root.At("frames").Elements()) {
    node.RequireKeys({"image", "reading_mm"});
    const YamlNode image = node.At("image");
    const std::string path = image.ResolvePath(image.Text());
    std::error_code failure;
    if (!fs::is_regular_file(path, failure))
      throw image.ErrorHere(fmt::format("the file '{}' does not exist", path));
    if (!images.insert(path).second)
      throw image.ErrorHere(fmt::format("'{}' stands in this list twice", image.Text()));
    sweep->frames.push_back({path, node.At("reading_mm").Number()});
  }
  if (sweep->frames.empty()) throw root.At("frames").ErrorHere("a frame at least is expected");
}

void NoteOrderAndRepeats(const SweepFile& sweep, std::vector<std::string>* notices) {
  if (notices == nullptr) return;
  std::vector<double> readings;
  for (const SweepFrame& frame : sweep.frames) readings.push_back(frame.reading_mm);
  const bool sorted = std::is_sorted(readings.begin(), readings.end()) ||
                      std::is_sorted(readings.rbegin(), readings.rend());
  if (!sorted) notices->push_back("the readings are not in order; they are used as they are");
  const std::set<double> distinct(readings.begin(), readings.end());
  if (distinct.size() < readings.size()) {
    notices->push_back(fmt::format("{} frames share their reading with another",
                                   readings.size() - distinct.size()));
  }
  if (!sweep.reading_sigma_stated) {
    notices->push_back(
        "reading_sigma_mm is not stated: the scatter about the law of image scale stands for it, "
        "or 0 where "
        "there is none");
  }
}

}  // namespace

std::string BenchDirectionName(BenchDirection direction) {
  return direction == BenchDirection::kAway ? "away" : "toward";
}

double DirectionSign(BenchDirection direction) {
  return direction == BenchDirection::kAway ? 1 : -1;
}

std::string SweepTargetName(SweepTarget target) {
  switch (target) {
    case SweepTarget::kTexture:
      return "texture";
    case SweepTarget::kPrintedEdge:
      return "printed-edge";
    case SweepTarget::kKnifeEdge:
      return "knife-edge";
    default:
      return "auto";
  }
}

SweepFile ReadSweep(const std::string& path, std::vector<std::string>* notices) {
  const YamlNode root = YamlNode::LoadFile(path);
  root.RequireSchema(kSchema);
  root.RequireKeys({"schema", "camera", "readings_unit", "reading_sigma_mm", "offset_mm",
                    "direction", "target", "target_period_mm", "blur_floor_px", "roi_px", "frames",
                    "frames_csv", "frames_dir", "frames_glob"});
  SweepFile sweep;
  sweep.source = path;
  const YamlNode camera = root.At("camera");
  sweep.camera_path = camera.ResolvePath(camera.Text());
  double mm_per_unit = 1;
  if (const auto unit = root.Find("readings_unit")) {
    mm_per_unit = MillimetresPer(unit->OneOf({"mm", "um", "cm", "m", "in"}));
    if (mm_per_unit != 1 && root.Has("frames")) {
      throw unit->ErrorHere("'frames' states reading_mm; another unit goes with 'frames_csv'");
    }
  }
  if (const auto sigma = root.Find("reading_sigma_mm")) {
    sweep.reading_sigma_mm = sigma->NonNegativeNumber();
    sweep.reading_sigma_stated = true;
  }
  ReadOffset(root, &sweep);
  if (const auto direction = root.Find("direction")) {
    sweep.direction = direction->OneOf({"away", "toward"}) == "away" ? BenchDirection::kAway
                                                                     : BenchDirection::kToward;
  }
  if (const auto target = root.Find("target")) {
    const std::string name = target->OneOf({"auto", "texture", "printed-edge", "knife-edge"});
    for (const SweepTarget kind :
         {SweepTarget::kTexture, SweepTarget::kPrintedEdge, SweepTarget::kKnifeEdge}) {
      if (name == SweepTargetName(kind)) sweep.target = kind;
    }
  }
  if (const auto period = root.Find("target_period_mm"))
    sweep.target_period_mm = period->PositiveNumber();
  ReadFloor(root, &sweep);
  if (const auto roi = root.Find("roi_px")) {
    const auto numbers = roi->ElementsExactly(4);
    constexpr int kMax = 100000;
    sweep.roi = {numbers[0].Integer(0, kMax), numbers[1].Integer(0, kMax),
                 numbers[2].Integer(1, kMax), numbers[3].Integer(1, kMax)};
  }
  ReadFrames(root, mm_per_unit, &sweep);
  NoteOrderAndRepeats(sweep, notices);
  return sweep;
}

void TakeFloorOfCalibration(const std::string& camera_path, const std::string& place,
                            SweepFile* sweep) {
  Camera camera;
  try {
    camera = ReadCamera(camera_path);
  } catch (const Error& error) {
    throw Error(place + error.what());
  }
  if (!camera.calibration) {
    throw Error(fmt::format(
        "{}{} holds no calibration: a camera that thicklens calibrate has written is expected",
        place, camera_path));
  }
  const std::string& method = camera.calibration->evidence.method;
  if (method == "assumed" || method == "source-recipe") {
    throw Error(fmt::format(
        "{}{}: calibration.evidence.method is '{}', which measures no floor: calibrate on a sweep "
        "of a knife edge",
        place, camera_path, method));
  }
  if (!camera.calibration->blur_floor_px) {
    throw Error(fmt::format(
        "{}{} holds no calibration.blur_floor_px: its sweep did not determine the floor, one of a "
        "knife edge does",
        place, camera_path));
  }
  sweep->floor = {};
  sweep->floor.given_px = *camera.calibration->blur_floor_px;
  sweep->floor_origin = FloorOrigin{place, camera_path, camera.lens, camera.sensor.pixel_pitch_mm};
}

void RequireFloorOfCamera(const SweepFile& sweep, const Camera& camera) {
  if (!sweep.floor_origin) return;
  const FloorOrigin& origin = *sweep.floor_origin;
  const auto require_same = [&](const char* field, double theirs, double ours) {
    // The same number may have been written with other digits.
    if (std::abs(theirs - ours) <= 1e-6 * std::max(std::abs(theirs), std::abs(ours))) return;
    throw Error(fmt::format(
        "{}{} has {} {}, the camera '{}' of this sweep {}: a blur floor holds for one lens, "
        "aperture and pixel pitch",
        origin.place, origin.camera_path, field, theirs, camera.name, ours));
  };
  const ThickLens& a = origin.lens;
  const ThickLens& b = camera.lens;
  require_same("lens.front_focal_length_mm", a.front_focal_length_mm, b.front_focal_length_mm);
  require_same("lens.rear_focal_length_mm", a.rear_focal_length_mm, b.rear_focal_length_mm);
  require_same("lens.lens_thickness_mm", a.lens_thickness_mm, b.lens_thickness_mm);
  require_same("lens.aperture_radius_mm", a.aperture_radius_mm, b.aperture_radius_mm);
  require_same("sensor.pixel_pitch_mm", origin.pixel_pitch_mm, camera.sensor.pixel_pitch_mm);
}

SweepFile SweepFromFolder(const std::string& folder, const std::string& readings_csv,
                          const std::string& camera_path, std::vector<std::string>* notices) {
  SweepFile sweep;
  sweep.source = folder;
  sweep.camera_path = camera_path;
  sweep.frames = JoinRowsAndFiles(ReadReadingsTable(readings_csv), readings_csv, PicturesIn(folder),
                                  folder, 1);
  NoteOrderAndRepeats(sweep, notices);
  return sweep;
}

std::string SweepToYaml(const SweepFile& sweep) {
  YAML::Emitter out;
  const auto text = [&](const char* key, const std::string& value) {
    out << YAML::Key << key << YAML::Value << value;
  };
  const auto number = [&](const char* key, double value) { text(key, YamlNumber(value)); };
  const auto estimate = [&](const char* key, const Estimate& value) {
    out << YAML::Key << key << YAML::Value << YAML::Flow << YAML::BeginMap;
    number("value", value.value);
    number("sigma", value.sigma);
    out << YAML::EndMap;
  };
  out << YAML::BeginMap;
  text("schema", kSchema);
  text("camera", sweep.camera_path);
  if (sweep.reading_sigma_stated) number("reading_sigma_mm", sweep.reading_sigma_mm);
  if (sweep.offset_mm) {
    estimate("offset_mm", *sweep.offset_mm);
  } else {
    text("offset_mm", "unknown");
  }
  text("direction", BenchDirectionName(sweep.direction));
  text("target", SweepTargetName(sweep.target));
  if (sweep.target_period_mm) number("target_period_mm", *sweep.target_period_mm);
  if (sweep.floor.given_px) {
    estimate("blur_floor_px", *sweep.floor.given_px);
  } else if (sweep.floor.from_px) {
    out << YAML::Key << "blur_floor_px" << YAML::Value << YAML::Flow << YAML::BeginMap;
    number("from", *sweep.floor.from_px);
    number("to", *sweep.floor.to_px);
    out << YAML::EndMap;
  } else {
    text("blur_floor_px", "unknown");
  }
  if (sweep.roi.width > 0) {
    out << YAML::Key << "roi_px" << YAML::Value << YAML::Flow
        << std::vector<int>{sweep.roi.x, sweep.roi.y, sweep.roi.width, sweep.roi.height};
  }
  out << YAML::Key << "frames" << YAML::Value << YAML::BeginSeq;
  for (const SweepFrame& frame : sweep.frames) {
    out << YAML::Flow << YAML::BeginMap;
    text("image", frame.image);
    number("reading_mm", frame.reading_mm);
    out << YAML::EndMap;
  }
  out << YAML::EndSeq << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

SweepTruth ReadSweepTruth(const std::string& path) {
  const YamlNode root = YamlNode::LoadFile(path);
  root.RequireSchema(kTruthSchema);
  root.RequireKeys({"schema", "image_distance_mm", "focus_depth_mm", "blur_ratio", "blur_floor_px",
                    "bench_offset_mm", "frames"});
  SweepTruth truth;
  truth.image_distance_mm = root.At("image_distance_mm").PositiveNumber();
  truth.focus_depth_mm = root.At("focus_depth_mm").PositiveNumber();
  truth.blur_ratio = root.At("blur_ratio").NonNegativeNumber();
  truth.blur_floor_px = root.At("blur_floor_px").NonNegativeNumber();
  truth.bench_offset_mm = root.At("bench_offset_mm").Number();
  for (const YamlNode& node : root.At("frames").Elements()) {
    node.RequireKeys({"image", "depth_mm", "reading_mm", "blur_sigma_px"});
    truth.frames.push_back({node.At("image").Text(), node.At("depth_mm").Number(),
                            node.At("reading_mm").Number(),
                            node.At("blur_sigma_px").NonNegativeNumber()});
  }
  return truth;
}

std::string SweepTruthToYaml(const SweepTruth& truth) {
  YAML::Emitter out;
  const auto number = [&](const char* key, double value) {
    out << YAML::Key << key << YAML::Value << YamlNumber(value);
  };
  out << YAML::BeginMap << YAML::Key << "schema" << YAML::Value << kTruthSchema;
  number("image_distance_mm", truth.image_distance_mm);
  number("focus_depth_mm", truth.focus_depth_mm);
  number("blur_ratio", truth.blur_ratio);
  number("blur_floor_px", truth.blur_floor_px);
  number("bench_offset_mm", truth.bench_offset_mm);
  out << YAML::Key << "frames" << YAML::Value << YAML::BeginSeq;
  for (const SweepTruth::Frame& frame : truth.frames) {
    out << YAML::Flow << YAML::BeginMap << YAML::Key << "image" << YAML::Value << frame.image;
    number("depth_mm", frame.depth_mm);
    number("reading_mm", frame.reading_mm);
    number("blur_sigma_px", frame.blur_sigma_px);
    out << YAML::EndMap;
  }
  out << YAML::EndSeq << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

}  // namespace thicklens::model
