#include "thicklens/sweep.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <map>
#include <system_error>
#include <utility>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/input_file.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/yaml_reader.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/distortion.h"
#include "thicklens/frames.h"
#include "thicklens/io/frame_files.h"
#include "thicklens/io/full_scale.h"
#include "thicklens/io/image_file.h"
#include "thicklens/io/readings.h"
#include "thicklens/io/video_file.h"
#include "thicklens/model/camera_file.h"
#include "thicklens/model/growing_sweep.h"
#include "thicklens/opencv.h"
#include "tools/interface/frame_light.h"
#include "tools/interface/missing_tolerances.h"
#include "tools/interface/run_scope.h"
#include "tools/interface/stated_transfer.h"
#include "tools/interface/sweep_of_frames.h"
#include "tools/interface/validation.h"
#include "tools/interface/with_file_context.h"

namespace thicklens {
namespace {

namespace fs = std::filesystem;

constexpr char kSweepName[] = "sweep.yaml";
constexpr char kTruthName[] = "truth.yaml";
constexpr char kNoDistortion[] = "none";

void ApplyOverrides(const SweepOverrides& overrides, const RunScope& run, model::SweepFile* file) {
  if (overrides.offset_unknown) file->offset_mm.reset();
  if (overrides.offset_mm) file->offset_mm = Measured{*overrides.offset_mm, 0};
  if (overrides.offset_sigma_mm) {
    if (!file->offset_mm) {
      throw OptionError("offset_sigma_mm",
                        fmt::format("offset_sigma_mm: the offset itself is missing, give {}",
                                    run.Option("offset_mm")));
    }
    file->offset_mm->sigma = *overrides.offset_sigma_mm;
  }
  if (!overrides.floor_from_calibration.empty()) {
    model::TakeFloorOfCalibration(overrides.floor_from_calibration,
                                  run.Option("floor_from_calibration") + ": ", file);
  } else if (overrides.floor_unknown || overrides.floor_px) {
    file->floor = {};
    file->floor_origin.reset();
    file->floor.given_px = overrides.floor_px;
  }
  if (overrides.focus_depth_mm) file->focus_depth_mm = overrides.focus_depth_mm;
  if (overrides.working_distance_mm) file->working_distance_mm = overrides.working_distance_mm;
  if (overrides.image_distance_mm) file->image_distance_mm = overrides.image_distance_mm;
  if (overrides.optical_tube_length_mm)
    file->optical_tube_length_mm = overrides.optical_tube_length_mm;
  if (overrides.magnification) file->magnification = overrides.magnification;
  if (overrides.target_period_mm) file->target_period_mm = overrides.target_period_mm;
  if (overrides.target_grid) file->target_grid = overrides.target_grid;
  if (!overrides.grid_views.empty()) {
    if (!file->target_grid) {
      throw OptionError(
          "grid_views",
          fmt::format("grid_views: the grid that these images show is missing, give {}",
                      run.Option("target_grid")));
    }
    file->grid_views = model::ImagesOfFolder(overrides.grid_views);
    if (file->grid_views.empty())
      throw Error(fmt::format("{}: the folder contains no image", overrides.grid_views));
  }
  if (overrides.stage_alignment_deg) file->stage_alignment_deg = overrides.stage_alignment_deg;
  if (overrides.roi) file->roi = *overrides.roi;
  if (overrides.full_scale) file->full_scale = overrides.full_scale;
  if (overrides.raw) file->raw = *overrides.raw;
  const model::CorrectionFiles& correction = overrides.correction;
  if (!correction.dark.empty()) file->correction.dark = correction.dark;
  if (!correction.flat.empty()) file->correction.flat = correction.flat;
  if (!correction.defects.empty()) file->correction.defects = correction.defects;
  if (overrides.reading_sigma_mm) {
    file->reading_sigma_mm = *overrides.reading_sigma_mm;
    file->reading_sigma_stated = true;
  }
  if (overrides.direction) file->direction = *overrides.direction;
  if (overrides.moves) file->moves = overrides.moves;
  if (overrides.target) file->target = *overrides.target;
}

// Compression removes fine detail, which looks like blur, and a fit of the frames alone cannot
// separate the two: on a simulated sweep with 1 px of blur, quality 90 changes kappa by 1 %.
void NoteCompression(const std::vector<model::SweepFrame>& frames,
                     std::vector<std::string>* notices) {
  std::map<std::string, bool> is_jpeg;  // a file may have many frames
  for (const model::SweepFrame& frame : frames) {
    if (is_jpeg.count(frame.image) == 0) is_jpeg.emplace(frame.image, io::IsJpegFile(frame.image));
  }
  const auto jpegs = std::count_if(frames.begin(), frames.end(),
                                   [&](const auto& frame) { return is_jpeg.at(frame.image); });
  if (jpegs == 0) return;
  notices->push_back(
      fmt::format("{} of {} frames are JPEG files: compression removes fine detail as blur does, "
                  "and the stated errors do not include its effect on zf and kappa (about 1 % of "
                  "kappa at quality 90 and 1 px of blur); use PNG or TIFF if 1 % matters",
                  jpegs, frames.size()));
}

// A file that merely happens to be called truth.yaml must not stop a calibration.
std::optional<model::SweepTruth> ReadTruth(const std::string& truth_path,
                                           const std::string& sweep_yaml,
                                           std::vector<std::string>* notices) {
  if (!truth_path.empty()) return model::ReadSweepTruth(truth_path);
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

// A sweep whose frames are the pages of one file; `table` is empty if its OME-XML has the readings.
model::SweepFile SweepOfStack(const std::string& path, const std::string& table,
                              const SweepOverrides& overrides, std::vector<std::string>* notices) {
  const model::ReadingOptions& options = overrides.readings;
  if (!options.name_pattern.empty() || options.source == "exif" || options.source == "sidecar") {
    throw OptionError("readings.source",
                      fmt::format("readings.source: the pages of {} have one name and one set of "
                                  "metadata; a table or OME-XML states their readings",
                                  path));
  }
  const std::string bytes = ReadWholeFile(path);
  const int pages = io::PagesOfImage(bytes, path);
  if (pages < 2) {
    throw Error(fmt::format(
        "{}: it has one image; a folder of frames or a file of several pages is expected", path));
  }
  io::ImageReading first;
  first.page = 0;
  const model::ReadingSet readings =
      table.empty() ? io::ReadingsOfPages(io::DecodeImageFile(bytes, path, first).facts.description,
                                          path, options)
                    : io::ReadReadings(table, {path}, options);
  return model::SweepFromPages(path, pages, readings, overrides.camera_path, notices);
}

std::string BitRateText(double bits_per_second) {
  constexpr double kMega = 1e6, kKilo = 1e3;
  return bits_per_second >= kMega ? fmt::format("{:.3g} Mbit/s", bits_per_second / kMega)
                                  : fmt::format("{:.3g} kbit/s", bits_per_second / kKilo);
}

// Says that frames of a video are compressed, and no more: how much of their detail is lost is not
// known from the file.
std::string CompressionOfVideo(const std::string& path, const io::VideoFacts& video,
                               const io::VideoCompression* measured) {
  std::string amount;
  if (measured != nullptr) {
    if (measured->bits_per_second) amount = ", " + BitRateText(*measured->bits_per_second);
    amount += fmt::format(", {:.3g} bits per pixel", measured->bits_per_pixel);
  }
  return fmt::format(
      "{}: its frames are compressed ({}{}); the stated errors include no part for what the "
      "compression changes",
      path, video.codec, amount);
}
bool IsCompressionOfVideo(const std::string& notice) {
  return notice.find(": its frames are compressed (") != std::string::npos;
}

void NoteVideo(const std::string& path, const io::VideoSurvey& survey,
               std::vector<std::string>* notices) {
  const io::VideoFacts& video = *survey.facts.video;
  if (!video.is_lossless) notices->push_back(CompressionOfVideo(path, video, &survey.compression));
  if (survey.is_interlaced) {
    notices->push_back(fmt::format(
        "{}: it is interlaced: the even and the odd rows of a frame are of two times, half a frame "
        "apart, and one reading is taken for both",
        path));
  }
  if (video.pixel_aspect != 1) {
    notices->push_back(fmt::format(
        "{}: it states pixels that are {:.4g} times as wide as high; they are used as stored, with "
        "the one pixel pitch of the camera file",
        path, video.pixel_aspect));
  }
}

// The frames of a video, which is decoded once.
std::vector<model::VideoFrame> FramesOfVideo(const std::string& path,
                                             std::vector<std::string>* notices) {
  io::VideoSurvey survey = io::VideoFile(path).Survey();
  if (notices != nullptr) NoteVideo(path, survey, notices);
  return std::move(survey.frames);
}

model::SweepReading ReadingOf(const SweepOverrides& overrides) {
  return {overrides.readings, io::ReadReadings, overrides.video, FramesOfVideo};
}

bool HasVideoOptions(const SweepOverrides& overrides) {
  return overrides.video.IsGiven() || !overrides.readings.time_column.empty() ||
         !overrides.readings.time_unit.empty();
}

void RequireNoVideoOptions(const std::string& path, const SweepOverrides& overrides) {
  if (!HasVideoOptions(overrides)) return;
  throw OptionError(
      "video", fmt::format("video: times, a constant speed and a choice of frames are for a video; "
                           "{} is none",
                           path));
}

// A sweep whose frames are those of a video.
model::SweepFile SweepOfVideo(const std::string& path, const std::string& table,
                              const SweepOverrides& overrides, std::vector<std::string>* notices) {
  const model::ReadingOptions& options = overrides.readings;
  if (options.IsWithoutTable()) {
    throw OptionError("readings.source",
                      fmt::format("readings.source: the frames of {} have one name and one set of "
                                  "metadata; a table or a constant speed states their readings",
                                  path));
  }
  if (table.empty() == !overrides.video.reading_start.has_value()) {
    throw OptionError(
        "readings",
        fmt::format("readings: {} needs either a table of its readings, by time or by frame, or a "
                    "constant speed (video.reading_start and video.reading_end)",
                    path));
  }
  model::VideoTable readings;
  if (!table.empty()) readings = model::ReadVideoTable(table, path, options, io::ReadReadings);
  return model::SweepFromVideo(path, FramesOfVideo(path, notices), readings, overrides.video,
                               options, overrides.camera_path, notices);
}

// Whether the input is taken for a video: by its content, or by its name, so that a broken one is
// refused as such.
bool IsVideo(const std::string& input) {
  std::error_code failure;
  return fs::is_regular_file(input, failure) &&
         (io::IsVideoFile(input) || io::IsNameOfVideo(input));
}

// The file whose pages are the frames: the input itself, or the only image in the folder.
std::optional<std::string> StackOf(const std::string& input) {
  std::error_code failure;
  if (!fs::is_directory(input, failure)) return input;
  const std::vector<std::string> images = model::ImagesOfFolder(input);
  if (images.size() != 1) return std::nullopt;
  const std::string& path = images.front();
  try {
    if (io::PagesOfImage(ReadWholeFile(path), path) < 2) return std::nullopt;
  } catch (const Interrupted&) {
    throw;
  } catch (const Error&) {
    return std::nullopt;  // whoever reads the frame says why it cannot be read
  }
  return path;
}

// The distortion of the frames: that of the overrides, or of the camera file.
void TakeDistortion(const std::string& stated, const RunScope& run, Sweep* sweep) {
  Camera& camera = sweep->camera;
  if (stated == kNoDistortion) {
    if (camera.distortion) {
      sweep->notices.push_back(
          fmt::format("{}: its lens.distortion is not used: the frames are undistorted already ({} "
                      "{}), and the "
                      "camera file that is written states none",
                      camera.source, run.Option("distortion"), kNoDistortion));
    }
    camera.distortion.reset();
  } else if (!stated.empty()) {
    RunControl control = run.control();
    control.notice = [sweep](const Notice& notice) { sweep->notices.push_back(notice.text); };
    camera.distortion = WithFileContext(run.Option("distortion"), [&] {
      return ReadLensDistortion(stated, camera.sensor.width_px, camera.sensor.height_px, control);
    });
    std::string why;
    if (!camera.IsValid(&why)) throw Error(fmt::format("{}: {}", run.Option("distortion"), why));
  }
}

// Says which part of the undistorted frames is measured, if it is not the whole.
void NoteRegionWithSource(const model::RegionOfInterest& stated, Sweep* sweep) {
  if (!sweep->camera.distortion) return;
  const model::RegionOfInterest roi = calib::MakeFocusSweep(sweep->description, sweep->camera).roi;
  if (roi.width == stated.width && roi.height == stated.height) return;
  sweep->notices.push_back(
      fmt::format("the frames do not show the whole field of their undistorted images: {} x {} px "
                  "from ({}, {}) "
                  "are measured",
                  roi.width, roi.height, roi.x, roi.y));
}

Sweep Finish(model::SweepFile file, const std::string& sweep_yaml, const SweepOverrides& overrides,
             const RunScope& run, Sweep sweep) {
  ApplyOverrides(overrides, run, &file);
  if (file.reading_sigma_stated) {  // the file does not state it, but the overrides do
    const auto is_moot = [](const std::string& notice) {
      return notice.rfind("reading_sigma_mm is not stated", 0) == 0;
    };
    sweep.notices.erase(std::remove_if(sweep.notices.begin(), sweep.notices.end(), is_moot),
                        sweep.notices.end());
  }
  NoteCompression(file.frames, &sweep.notices);
  sweep.truth = ReadTruth(overrides.truth_path, sweep_yaml, &sweep.notices);
  sweep.camera = model::ReadCamera(file.camera_path);
  TakeDistortion(overrides.distortion, run, &sweep);
  calib::MakeFocusSweep(file, sweep.camera);  // throws if the floor is of another camera
  if (!sweep.truth) {                         // the parameters of a simulated camera are exact
    const std::string missing = MissingTolerancesLine(sweep.camera);
    if (!missing.empty()) sweep.notices.push_back(missing);
    const std::string objective = ObjectiveLine(
        sweep.camera, file.magnification || file.target_period_mm || file.target_grid);
    if (!objective.empty()) sweep.notices.push_back(objective);
  }
  sweep.description = std::move(file);
  NoteRegionWithSource(sweep.description.roi, &sweep);
  return sweep;
}

// Whether another full scale gives the same calibration: it multiplies linear light by a constant.
bool IsScaleFree(const TransferCurve& transfer) { return !(transfer == TransferCurve::Srgb()); }

// Returns what the values of all frames show; frames are read until it is certain.
io::FullScaleFinding FullScaleOfFrames(const std::vector<model::SweepFrame>& frames) {
  io::ValueCounter values;
  io::FrameFiles files(frames);  // opens a file of many frames once
  for (std::size_t i = 0; i < frames.size(); ++i) {
    ThrowIfCancelled();
    values.Add(files.Read(i), frames[i].Name());
    if (values.UsesWholeContainer()) break;
  }
  return values.Finding();
}

void TakeFullScale(const io::FullScaleFinding& finding, const RunScope& run, Sweep* sweep) {
  // Below this value, frames of 16 bits are too dark to be measured, and values of fewer bits would
  // be refused as if they were.
  constexpr int kTooDark = 1023;
  sweep->full_scale_reason = finding.reason;
  const bool is_aligned = finding.kind == io::FullScaleFinding::Kind::kLeftAligned ||
                          finding.kind == io::FullScaleFinding::Kind::kRightAligned;
  if (is_aligned) {
    sweep->description.full_scale = finding.full_scale;
    sweep->full_scale_reason =
        fmt::format("{}: {}-aligned values of {} bits, {} is full scale", finding.reason,
                    finding.kind == io::FullScaleFinding::Kind::kLeftAligned ? "left" : "right",
                    finding.bits, finding.full_scale);
  }
  if (finding.kind != io::FullScaleFinding::Kind::kUndecided) return;
  const std::string remedy = fmt::format("state it: {} {}, or 65535 for 16 bits",
                                         run.Option("full_scale"), finding.full_scale);
  if (finding.full_scale <= kTooDark || !IsScaleFree(sweep->camera.sensor.transfer)) {
    throw UndecidedFullScale(
        fmt::format("{}: {}; {}", sweep->description.source, finding.reason, remedy));
  }
  sweep->notices.push_back(
      fmt::format("{}; 65535 is taken as full scale, and with the transfer curve {} the result "
                  "does not depend on it; {}",
                  finding.reason, sweep->camera.sensor.transfer.Name(), remedy));
}

// The sweep with the correction that its description names, checked against a frame.
void TakeCorrection(CorrectedFrame frame, const RunScope& run, Sweep* sweep) {
  frame.transfer = sweep->camera.sensor.transfer;
  frame.roi = sweep->description.roi;
  FrameAverageOptions options;
  options.full_scale = sweep->description.full_scale;
  options.raw = sweep->description.raw;
  FrameCorrectionFiles found =
      ReadFrameCorrection(sweep->description.correction, frame, options, run.control());
  sweep->correction = std::move(found.correction);
  sweep->correction_lines = std::move(found.lines);
  for (std::string& notice : found.notices) sweep->notices.push_back(std::move(notice));
}

bool NeedsCorrection(const Sweep& sweep) {
  return sweep.correction == nullptr && !sweep.description.correction.IsEmpty() &&
         !sweep.description.frames.empty();
}

// The first frame as it is measured.
CorrectedFrame FirstFrame(const Sweep& sweep, const io::ImageFacts& facts) {
  CorrectedFrame frame;
  frame.name = sweep.description.frames.front().Name();
  io::FrameFiles files({sweep.description.frames.front()}, sweep.description.full_scale,
                       sweep.description.raw == model::SweepRaw::kGreen
                           ? io::RawTreatment::kMosaicGreen
                           : io::RawTreatment::kDemosaiced);
  frame.stored = files.Read(0);
  frame.stated_transfer = StatedTransferName(facts);
  const auto read = files.Files();
  frame.sensor = SensorTextOf(read.front().facts);
  return frame;
}

OptionError NotRaw(const std::string& frame, const RunScope& run) {
  return OptionError(
      "raw",
      fmt::format("raw: the green sites of a mosaic are in raw files only; {} is none, leave "
                  "{} out",
                  frame, run.Option("raw")));
}

}  // namespace

FrameSource::~FrameSource() = default;

bool Sweep::IsValid(std::string* why) const {
  for (const model::SweepFrame& frame : description.frames) {
    if (!checks::Finite(why, "description.frames.reading_mm", frame.reading_mm)) return false;
  }
  if (!checks::NonNegative(why, "description.reading_sigma_mm", description.reading_sigma_mm)) {
    return false;
  }
  try {
    calib::FocusSweep sweep = calib::MakeFocusSweep(description, camera);
    sweep.read_frame = [](std::size_t /*index*/) { return cv::Mat(); };  // not called
    std::string reason;
    return sweep.IsValid(&reason) || checks::Fail(why, "description", reason);
  } catch (const Error& error) {  // the floor is of another camera
    return checks::Fail(why, "description", error.what());
  }
}

Sweep ReadSweep(const std::string& path, const SweepOverrides& overrides,
                const RunControl& control) {
  checks::RequireValid(control);
  checks::RequireValid(overrides);
  const RunScope run(control);
  std::error_code failure;
  std::string yaml = path;
  if (fs::is_directory(path, failure)) {
    const fs::path inside = fs::path(path) / kSweepName;
    if (!fs::exists(inside, failure)) {
      throw Error(
          fmt::format("{}: a folder without {} is read by ReadSweepFolder, with a table of "
                      "readings and a camera",
                      path, kSweepName));
    }
    yaml = inside.string();
  }
  // The options for a video complete the statements of a sweep file that has one.
  if (HasVideoOptions(overrides) && !YamlNode::LoadFile(yaml).Has("video"))
    RequireNoVideoOptions(path, overrides);
  Sweep sweep;
  model::SweepFile file = model::ReadSweep(yaml, ReadingOf(overrides), &sweep.notices);
  if (!overrides.camera_path.empty()) file.camera_path = overrides.camera_path;
  return Finish(std::move(file), yaml, overrides, run, std::move(sweep));
}

Sweep ReadSweepFolder(const std::string& folder, const std::string& readings_csv,
                      const SweepOverrides& overrides, const RunControl& control) {
  checks::RequireValid(control);
  checks::RequireValid(overrides);
  const RunScope run(control);
  if (overrides.camera_path.empty()) {
    throw OptionError(
        "camera_path",
        fmt::format("camera_path: {} is a folder with a table of readings, which also "
                    "needs a camera file (thicklens camera init makes one)",
                    folder));
  }
  const bool is_without_table = overrides.readings.IsWithoutTable();
  Sweep sweep;
  if (IsVideo(folder)) {
    model::SweepFile file = SweepOfVideo(folder, readings_csv, overrides, &sweep.notices);
    return Finish(std::move(file), "", overrides, run, std::move(sweep));
  }
  RequireNoVideoOptions(folder, overrides);
  if (const auto stack = StackOf(folder); stack && (readings_csv.empty() || !is_without_table)) {
    model::SweepFile file = SweepOfStack(*stack, readings_csv, overrides, &sweep.notices);
    return Finish(std::move(file), "", overrides, run, std::move(sweep));
  }
  if (readings_csv.empty() != is_without_table) {
    throw OptionError(
        "readings",
        readings_csv.empty()
            ? fmt::format("readings: {} has no table of readings, and neither name_pattern nor "
                          "source says where the readings are",
                          folder)
            : fmt::format("readings: either the table {} or the files themselves have the readings",
                          readings_csv));
  }
  model::SweepFile file = model::SweepFromFolder(folder, readings_csv, overrides.camera_path,
                                                 ReadingOf(overrides), &sweep.notices);
  return Finish(std::move(file), "", overrides, run, std::move(sweep));
}

SweepOfFrames ReadSweepOfFrames(const std::string& folder, const std::vector<std::string>& images,
                                const std::string& readings_csv, const SweepOverrides& overrides,
                                const RunControl& control) {
  checks::RequireValid(control);
  checks::RequireValid(overrides);
  const RunScope run(control);
  RequireNoVideoOptions(folder, overrides);
  SweepOfFrames found;
  model::GrowingSweep growing =
      model::SweepOfImages(folder, images, readings_csv, overrides.camera_path,
                           ReadingOf(overrides), &found.sweep.notices);
  found.without_reading = std::move(growing.without_reading);
  found.sweep = Finish(std::move(growing.sweep), "", overrides, run, std::move(found.sweep));
  return found;
}

Sweep ExamineFrames(Sweep sweep, const RunControl& control) {
  checks::RequireValid(control);
  const RunScope run(control);
  const std::vector<model::SweepFrame>& frames = sweep.description.frames;
  const bool is_done = !sweep.full_scale_reason.empty();
  if (sweep.frames != nullptr && NeedsCorrection(sweep)) {
    CorrectedFrame frame;
    frame.name = frames.front().image.empty() ? "frame 0" : frames.front().Name();
    frame.stored = FocusSweepOf(sweep).read_frame(0);
    TakeCorrection(std::move(frame), run, &sweep);
  }
  if (is_done && sweep.frames == nullptr && NeedsCorrection(sweep)) {
    io::ImageFacts facts;
    io::ReadFrame(frames.front(), &facts);
    TakeCorrection(FirstFrame(sweep, facts), run, &sweep);
  }
  if (sweep.frames != nullptr || is_done || frames.empty()) return sweep;
  const std::string path = frames.front().Name();
  io::ImageFacts facts;
  const cv::Mat first = io::ReadFrame(frames.front(), &facts);
  if (facts.raw && !(sweep.camera.sensor.transfer == TransferCurve::Linear())) {
    throw Error(fmt::format(
        "{}: the values of a raw file are linear, {} has sensor.transfer: {}: set it to linear",
        path, sweep.camera.source.empty() ? "the camera" : sweep.camera.source,
        sweep.camera.sensor.transfer.Name()));
  }
  if (!facts.raw && sweep.description.raw == model::SweepRaw::kGreen) throw NotRaw(path, run);
  const std::string contradiction = TransferContradiction(facts, sweep.camera);
  if (!contradiction.empty()) sweep.notices.push_back(fmt::format("{}: {}", path, contradiction));
  const bool is_noted =
      std::any_of(sweep.notices.begin(), sweep.notices.end(), IsCompressionOfVideo);
  if (facts.video && !facts.video->is_lossless && !is_noted)
    sweep.notices.push_back(CompressionOfVideo(frames.front().image, *facts.video, nullptr));
  const bool is_stated =
      facts.raw || (facts.significant_bits && *facts.significant_bits < facts.container_bits);
  if (sweep.description.full_scale) {
    sweep.full_scale_reason =
        fmt::format("{} is full scale, as stated", *sweep.description.full_scale);
  } else if (is_stated) {
    sweep.full_scale_reason = "the files state it";
  } else if (first.depth() != CV_16U) {
    sweep.full_scale_reason = "values of 8 bits";
  } else {
    TakeFullScale(FullScaleOfFrames(frames), run, &sweep);
  }
  if (NeedsCorrection(sweep)) TakeCorrection(FirstFrame(sweep, facts), run, &sweep);
  return sweep;
}

std::vector<std::string> NoticesOf(const Sweep& sweep) {
  std::vector<std::string> notices = sweep.notices;
  for (std::string& notice : NoticesOf(sweep.camera)) notices.push_back(std::move(notice));
  return notices;
}

}  // namespace thicklens
