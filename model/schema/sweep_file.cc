#include "thicklens/model/sweep_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "model/schema/frame_pairing.h"
#include "model/schema/sweep_frames.h"
#include "model/schema/sweep_grid.h"
#include "model/schema/yaml_fields.h"
#include "model/schema/yaml_writer.h"
#include "thicklens/base/yaml_reader.h"

namespace thicklens::model {
namespace {

constexpr char kSchema[] = "thicklens/sweep/1";
constexpr char kReadingsFile[] = "readings.csv";
constexpr SweepMotion kMotions[] = {SweepMotion::kTarget, SweepMotion::kCamera, SweepMotion::kLens,
                                    SweepMotion::kSensor};

bool IsUnknown(const YamlNode& node) { return node.IsScalar() && node.Text() == "unknown"; }

void ReadOffset(const YamlNode& root, SweepFile* sweep) {
  const auto node = root.Find("offset_mm");
  if (!node || IsUnknown(*node)) return;
  sweep->offset_mm = ReadEstimate(*node, &YamlNode::Number);
}

// The statements about the plane of focus, in the order in which they are written. Each is > 0.
struct FocusKey {
  const char* key;
  std::optional<Estimate> SweepFile::*field;
};
constexpr FocusKey kFocusKeys[] = {
    {"focus_depth_mm", &SweepFile::focus_depth_mm},
    {"working_distance_mm", &SweepFile::working_distance_mm},
    {"image_distance_mm", &SweepFile::image_distance_mm},
    {"optical_tube_length_mm", &SweepFile::optical_tube_length_mm},
    {"magnification", &SweepFile::magnification},
};

void ReadFocus(const YamlNode& root, SweepFile* sweep) {
  for (const FocusKey& of : kFocusKeys) {
    const auto node = root.Find(of.key);
    if (node && !IsUnknown(*node))
      sweep->*of.field = ReadEstimate(*node, &YamlNode::PositiveNumber);
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
        "exactly one of {value, sigma}, {from, to} and {from_calibration} is expected");
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
    sweep->floor.given_px = ReadEstimate(*node, &YamlNode::NonNegativeNumber);
  }
}

// The lists of files that correct the frames, in the order in which they are written.
struct CorrectionKey {
  const char* key;
  std::vector<std::string> CorrectionFiles::*field;
};
constexpr CorrectionKey kCorrectionKeys[] = {
    {"dark", &CorrectionFiles::dark},
    {"flat", &CorrectionFiles::flat},
    {"defects", &CorrectionFiles::defects},
};

void ReadCorrection(const YamlNode& root, SweepFile* sweep) {
  for (const CorrectionKey& of : kCorrectionKeys) {
    const auto node = root.Find(of.key);
    if (!node) continue;
    std::vector<std::string>& files = sweep->correction.*of.field;
    if (node->IsSequence()) {
      for (const YamlNode& file : node->Elements()) files.push_back(file.ResolvePath(file.Text()));
      if (files.empty()) throw node->ErrorHere("one file or more is expected");
    } else {
      files.push_back(node->ResolvePath(node->Text()));
    }
  }
}

}  // namespace

void NoteOrderAndRepeats(const SweepFile& sweep, std::vector<std::string>* notices) {
  if (notices == nullptr) return;
  std::vector<double> readings;
  for (const SweepFrame& frame : sweep.frames) readings.push_back(frame.reading_mm);
  const bool sorted = std::is_sorted(readings.begin(), readings.end()) ||
                      std::is_sorted(readings.rbegin(), readings.rend());
  if (!sorted) notices->push_back("the readings are not in order; they are used as they are");
  const std::set<double> distinct(readings.begin(), readings.end());
  if (distinct.size() < readings.size()) {
    notices->push_back(fmt::format("{} frames have the same reading as another frame",
                                   readings.size() - distinct.size()));
  }
  if (!sweep.reading_sigma_stated) {
    notices->push_back(
        "reading_sigma_mm is not stated: the scatter about the law of image scale is used instead, "
        "or 0 without such a law");
  }
}

std::string BenchDirectionName(BenchDirection direction) {
  return direction == BenchDirection::kAway ? "away" : "toward";
}

double DirectionSign(BenchDirection direction) {
  return direction == BenchDirection::kAway ? 1 : -1;
}

std::string SweepMotionName(SweepMotion motion) {
  switch (motion) {
    case SweepMotion::kCamera:
      return "camera";
    case SweepMotion::kLens:
      return "lens";
    case SweepMotion::kSensor:
      return "sensor";
    default:
      return "target";
  }
}

bool MovesFocus(SweepMotion motion) {
  return motion == SweepMotion::kLens || motion == SweepMotion::kSensor;
}

std::string SweepRawName(SweepRaw raw) { return raw == SweepRaw::kGreen ? "green" : "demosaiced"; }

std::string SweepTargetName(SweepTarget target) {
  switch (target) {
    case SweepTarget::kTexture:
      return "texture";
    case SweepTarget::kPrintedEdge:
      return "printed-edge";
    case SweepTarget::kKnifeEdge:
      return "knife-edge";
    case SweepTarget::kPoints:
      return "points";
    default:
      return "auto";
  }
}

SweepFile ReadSweep(const std::string& path, std::vector<std::string>* notices) {
  return ReadSweep(path, SweepReading{}, notices);
}

SweepFile ReadSweep(const std::string& path, const SweepReading& reading,
                    std::vector<std::string>* notices) {
  const YamlNode root = YamlNode::LoadFile(path);
  root.RequireSchema(kSchema);
  root.RequireKeys({"schema",
                    "camera",
                    "readings_unit",
                    "reading_sigma_mm",
                    "offset_mm",
                    "focus_depth_mm",
                    "working_distance_mm",
                    "image_distance_mm",
                    "optical_tube_length_mm",
                    "magnification",
                    "direction",
                    "moves",
                    "target",
                    "target_period_mm",
                    "target_grid",
                    "grid_views",
                    "stage_alignment_deg",
                    "blur_floor_px",
                    "roi_px",
                    "full_scale",
                    "raw",
                    "dark",
                    "flat",
                    "defects",
                    "frames",
                    "frames_csv",
                    "frames_dir",
                    "frames_glob",
                    "video",
                    "readings_column",
                    "readings_file_column",
                    "readings_scale_mm",
                    "readings_decimal",
                    "readings_from",
                    "readings_from_name",
                    "readings_time_column",
                    "readings_time_unit"});
  SweepFile sweep;
  sweep.source = path;
  const YamlNode camera = root.At("camera");
  sweep.camera_path = camera.ResolvePath(camera.Text());
  if (const auto sigma = root.Find("reading_sigma_mm")) {
    sweep.reading_sigma_mm = sigma->NonNegativeNumber();
    sweep.reading_sigma_stated = true;
  }
  ReadOffset(root, &sweep);
  ReadFocus(root, &sweep);
  if (const auto direction = root.Find("direction")) {
    sweep.direction = direction->OneOf({"away", "toward"}) == "away" ? BenchDirection::kAway
                                                                     : BenchDirection::kToward;
  }
  if (const auto moves = root.Find("moves")) {
    const std::string name = moves->OneOf({"target", "camera", "lens", "sensor"});
    for (const SweepMotion part : kMotions) {
      if (name == SweepMotionName(part)) sweep.moves = part;
    }
  }
  if (const auto target = root.Find("target")) {
    const std::string name =
        target->OneOf({"auto", "texture", "printed-edge", "knife-edge", "points"});
    for (const SweepTarget kind : {SweepTarget::kTexture, SweepTarget::kPrintedEdge,
                                   SweepTarget::kKnifeEdge, SweepTarget::kPoints}) {
      if (name == SweepTargetName(kind)) sweep.target = kind;
    }
  }
  if (const auto period = root.Find("target_period_mm"))
    sweep.target_period_mm = period->PositiveNumber();
  ReadGrid(root, &sweep);
  ReadFloor(root, &sweep);
  if (const auto roi = root.Find("roi_px")) {
    const auto numbers = roi->ElementsExactly(4);
    constexpr int kMax = 100000;
    sweep.roi = {numbers[0].Integer(0, kMax), numbers[1].Integer(0, kMax),
                 numbers[2].Integer(1, kMax), numbers[3].Integer(1, kMax)};
  }
  if (const auto white = root.Find("full_scale")) {
    constexpr int kMaxValue = 65535;
    sweep.full_scale = white->Integer(1, kMaxValue);
  }
  if (const auto raw = root.Find("raw")) {
    sweep.raw =
        raw->OneOf({"demosaiced", "green"}) == "green" ? SweepRaw::kGreen : SweepRaw::kDemosaiced;
  }
  ReadCorrection(root, &sweep);
  ReadSweepFrames(root, reading, &sweep, notices);
  NoteOrderAndRepeats(sweep, notices);
  return sweep;
}

SweepFile SweepFromFolder(const std::string& folder, const std::string& readings_csv,
                          const std::string& camera_path, std::vector<std::string>* notices) {
  return SweepFromFolder(folder, readings_csv, camera_path, SweepReading{}, notices);
}

SweepFile SweepFromFolder(const std::string& folder, const std::string& table,
                          const std::string& camera_path, const SweepReading& reading,
                          std::vector<std::string>* notices) {
  SweepFile sweep;
  sweep.source = folder;
  sweep.camera_path = camera_path;
  ReadFramesOfFolder(folder, table, reading, &sweep, notices);
  NoteOrderAndRepeats(sweep, notices);
  return sweep;
}

SweepFile SweepFromPages(const std::string& path, int pages, const ReadingSet& readings,
                         const std::string& camera_path, std::vector<std::string>* notices) {
  SweepFile sweep;
  sweep.source = path;
  sweep.camera_path = camera_path;
  sweep.frames = PairPages(readings, path, pages);
  sweep.readings = readings.description;
  sweep.readings_are_focus_distances = readings.in_dioptres;
  sweep.readings_are_counts = readings.in_counts;
  if (notices != nullptr)
    notices->insert(notices->end(), readings.notices.begin(), readings.notices.end());
  NoteOrderAndRepeats(sweep, notices);
  return sweep;
}

std::string ReadingsTable(const SweepFile& sweep) {
  std::string table = sweep.readings_are_counts ? "image,counts\n" : "image,reading_mm\n";
  for (const SweepFrame& frame : sweep.frames)
    table += fmt::format("{},{}\n", std::filesystem::path(frame.image).filename().string(),
                         frame.reading_mm);
  return table;
}

std::string SweepToYaml(const SweepFile& sweep) {
  YamlWriter out(kSchema);
  out.Text("camera", sweep.camera_path);
  if (sweep.reading_sigma_stated) out.Number("reading_sigma_mm", sweep.reading_sigma_mm);
  if (sweep.offset_mm) {
    out.Measured("offset_mm", *sweep.offset_mm);
  } else {
    out.Text("offset_mm", "unknown");
  }
  for (const FocusKey& of : kFocusKeys) {
    if (const auto& stated = sweep.*of.field) out.Measured(of.key, *stated);
  }
  out.Text("direction", BenchDirectionName(sweep.direction));
  if (sweep.moves) out.Text("moves", SweepMotionName(*sweep.moves));
  out.Text("target", SweepTargetName(sweep.target));
  out.NumberIfAny("target_period_mm", sweep.target_period_mm);
  WriteGrid(sweep, &out);
  if (sweep.floor.given_px) {
    out.Measured("blur_floor_px", *sweep.floor.given_px);
  } else if (sweep.floor.from_px) {
    out.BeginMapInLine("blur_floor_px");
    out.Number("from", *sweep.floor.from_px);
    out.Number("to", *sweep.floor.to_px);
    out.EndMap();
  } else {
    out.Text("blur_floor_px", "unknown");
  }
  if (sweep.roi.width > 0) {
    out.List("roi_px", {std::to_string(sweep.roi.x), std::to_string(sweep.roi.y),
                        std::to_string(sweep.roi.width), std::to_string(sweep.roi.height)});
  }
  if (sweep.full_scale) out.Number("full_scale", *sweep.full_scale);
  if (sweep.raw != SweepRaw::kDemosaiced) out.Text("raw", SweepRawName(sweep.raw));
  for (const CorrectionKey& of : kCorrectionKeys) {
    const std::vector<std::string>& files = sweep.correction.*of.field;
    if (!files.empty()) out.List(of.key, files);
  }
  if (sweep.readings_are_counts) {
    out.Text("frames_csv", kReadingsFile);
    if (!sweep.frames.empty()) {
      const std::string folder =
          std::filesystem::path(sweep.frames.front().image).parent_path().string();
      if (!folder.empty()) out.Text("frames_dir", folder);
    }
    out.Text("readings_unit", "counts");
    return out.Finish();
  }
  out.BeginList("frames");
  for (const SweepFrame& frame : sweep.frames) {
    out.BeginMapInLine();
    out.Text("image", frame.image);
    if (frame.page) out.Number("page", *frame.page);
    out.Number("reading_mm", frame.reading_mm);
    out.EndMap();
  }
  out.EndList();
  return out.Finish();
}

}  // namespace thicklens::model
