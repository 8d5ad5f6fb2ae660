// thicklens report: makes one page that shows all steps from the focus sweep to the light field.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "thicklens/base/cancel.h"
#include "thicklens/base/error.h"
#include "thicklens/base/output_file.h"
#include "thicklens/base/utc_time.h"
#include "thicklens/depth.h"
#include "thicklens/estimator/disparity_map.h"
#include "thicklens/io/aperture_statement.h"
#include "thicklens/io/frame_files.h"
#include "thicklens/io/image_io.h"
#include "thicklens/io/video_file.h"
#include "thicklens/light_field.h"
#include "thicklens/model/light_field.h"
#include "thicklens/model/light_field_grid.h"
#include "thicklens/model/sweep_file.h"
#include "tools/commands/commands.h"
#include "tools/options/command_frame.h"
#include "tools/options/embedded_depth.h"
#include "tools/options/interface_options.h"
#include "tools/options/light_field_options.h"
#include "tools/options/option_values.h"
#include "tools/options/with_file_context.h"
#include "tools/report/embedded_report.h"
#include "tools/report/estimate_records.h"
#include "tools/report/light_field_page.h"
#include "tools/system/build_info.h"

namespace thicklens::tools {
namespace {

namespace fs = std::filesystem;

constexpr char kSweepName[] = "sweep.yaml";
constexpr std::size_t kShots = 7;

struct ReportOptions {
  CommonOptions common;
  std::string light_field_path, output_path;
  std::string photo_path, depth_path, truth_path, sweep_path, calibration_path, estimate_path,
      comparison_path;
  DepthOptions depth;
  ReadingOptions reading;
};

// --crop applies to files of the whole image; files that were made from that crop stay as they
// are.
bool NeedsCrop(const std::optional<model::PixelRect>& crop, int width_px, int height_px) {
  return crop && (crop->width != width_px || crop->height != height_px);
}

[[noreturn]] void ThrowOtherSize(const std::string& path, int width_px, int height_px,
                                 const model::LightField& light_field) {
  throw Error(
      fmt::format("{}: it is {}x{} px, the views are {}x{} px: the sizes must be equal (--crop "
                  "crops all alike)",
                  path, width_px, height_px, light_field.s_count, light_field.t_count));
}

LightField ReadCropped(const CommonOptions& common, const std::string& path,
                       const ReadingOptions& options) {
  const CommandRun run(common, ReadingOptionNames());
  LightFieldReadOptions reading = LightFieldReadOptionsOf(options);
  const std::optional<model::PixelRect> crop = std::exchange(reading.crop, std::nullopt);
  LightField light_field = WithOptionNames(
      run.names(), [&] { return thicklens::ReadLightField(path, reading, run.control()); });
  if (NeedsCrop(crop, light_field.s_count, light_field.t_count)) {
    return WithFileContext(path, [&] { return model::CropViews(light_field, *crop); });
  }
  return light_field;
}

// Requires that the views have the same places on the aperture; otherwise they are not the truth of
// these views. The allowed difference is that between a true blur ratio and a calibrated one.
void RequireSameViewpoints(const ReportOptions& options, const model::LightField& truth,
                           const model::LightField& light_field) {
  constexpr double kTolerance = 0.05;
  if (!truth.grid || !light_field.grid) return;
  const double true_mm = std::abs(truth.grid->u_step_mm);
  const double step_mm = std::abs(light_field.grid->u_step_mm);
  if (light_field.u_count == 1 ||
      std::abs(true_mm - step_mm) <= kTolerance * std::max(true_mm, step_mm)) {
    return;
  }
  throw Error(
      fmt::format("{}: its views are {:.4g} mm apart, those of {} are {:.4g} mm apart: the "
                  "distances must be equal",
                  options.truth_path, true_mm, options.light_field_path, step_mm));
}

// Returns the true views that correspond to the views of the light field.
model::LightField ReadTruth(const ReportOptions& options, const model::LightField& light_field) {
  ReadingOptions reading = options.reading;
  reading.views.text.clear();
  model::LightField truth = ReadCropped(options.common, options.truth_path, reading);
  if (truth.s_count != light_field.s_count || truth.t_count != light_field.t_count) {
    ThrowOtherSize(options.truth_path, truth.s_count, truth.t_count, light_field);
  }
  if (truth.channels != light_field.channels) {
    throw Error(fmt::format("{}: it has {} channel(s), {} has {}: they must be equal",
                            options.truth_path, truth.channels, options.light_field_path,
                            light_field.channels));
  }
  RequireSameViewpoints(options, truth, light_field);
  if (const auto warning = io::DifferentApertures(options.truth_path, truth,
                                                  options.light_field_path, light_field)) {
    spdlog::warn("{}", *warning);
  }
  if (truth.u_count == light_field.u_count && truth.v_count == light_field.v_count) return truth;
  return WithFileContext(options.truth_path, [&] {
    return model::InnerViews(truth, light_field.u_count, light_field.v_count);
  });
}

model::LinearImage ReadPhoto(const ReportOptions& options, const model::LightField& light_field) {
  const auto crop = CropRect(options.reading.crop);
  cv::Mat stored = io::ReadImageFile(options.photo_path);
  if (stored.channels() == 4) cv::cvtColor(stored, stored, cv::COLOR_RGBA2RGB);
  model::EncodedImage photo = io::ToEncodedImage(stored);
  if (NeedsCrop(crop, photo.width_px, photo.height_px)) {
    photo = WithFileContext(options.photo_path, [&] { return model::CropImage(photo, *crop); });
  }
  if (photo.width_px != light_field.s_count || photo.height_px != light_field.t_count) {
    ThrowOtherSize(options.photo_path, photo.width_px, photo.height_px, light_field);
  }
  return model::ToLinear(photo, light_field.transfer);
}

// The depths of a light field are in mm if it has a camera; otherwise they are disparities.
PageDepth ReadPageDepth(const ReportOptions& options, const model::LightField& light_field) {
  model::DepthConvention convention = ConventionOf(options.depth);
  if (convention.kind != model::DepthKind::kDisparity && !light_field.camera) {
    throw UsageError(
        fmt::format("--depth-kind {}: {} has no camera, so its depth map must be a disparity",
                    options.depth.kind, options.light_field_path));
  }
  const DepthMap read = ReadDepth(options.depth_path, DepthMeaningOf(options.depth),
                                  DepthReadOptionsOf(options.depth), DepthRun());
  convention.inverse_scale_dpt = read.meaning.inverse_scale_dpt;
  convention.inverse_offset_dpt = read.meaning.inverse_offset_dpt;
  RunControl run = DepthRun();
  run.notice = ReportNotice;
  run.option_name = OptionNames{{"depth.holes", "--hole-value"},
                                {"depth.holes.zero_is_value", "--zero-is value"},
                                {"depth.holes.largest_is_value", "--largest-is value"}};
  model::RawDepthMap map = MarkedDepth(read, run);
  const auto crop = CropRect(options.reading.crop);
  if (NeedsCrop(crop, map.width_px, map.height_px)) {
    map = WithFileContext(options.depth_path, [&] { return model::CropDepth(map, *crop); });
  }
  if (map.width_px != light_field.s_count || map.height_px != light_field.t_count) {
    ThrowOtherSize(options.depth_path, map.width_px, map.height_px, light_field);
  }
  PageDepth depth{map.width_px, map.height_px, {}, light_field.camera.has_value()};
  if (!light_field.camera) {
    depth.values = WithFileContext(options.depth_path, [&] {
      return estimator::DisparityFromMap(map, convention.disparity_scale,
                                         convention.disparity_offset_px)
          .disparity;
    });
    return depth;
  }
  const model::LightFieldGrid& grid = *light_field.grid;
  // One view step along u, or along v if u has one view.
  const Eigen::Vector2d step_mm = model::ApertureStepsMm(grid, *light_field.camera);
  convention.aperture_step_mm = std::abs(step_mm.x() != 0 ? step_mm.x() : step_mm.y());
  // Only the size of the image matters here.
  model::LinearImage image{map.width_px, map.height_px, 1, {}};
  image.values.assign(map.values.size(), 0.0F);
  depth.values =
      model::MakeScene(*light_field.camera, std::move(image), map, convention, options.depth_path)
          .depth_mm;
  return depth;
}

// Returns the depths of the frames of a sweep up to a constant; larger is farther.
double RelativeDepthMm(const model::SweepFile& sweep, const model::SweepFrame& frame) {
  return model::DirectionSign(sweep.direction) * frame.reading_mm;
}

// Returns which of the frames, ordered from near to far, is nearest to the camera's plane of focus.
// Returns none if the bench offset is unknown, or if that plane lies more than a step outside the
// sweep.
std::optional<std::size_t> FrameInFocus(const model::SweepFile& sweep,
                                        const std::optional<model::Camera>& camera) {
  if (!camera || !camera->calibration || !camera->calibration->image_distance_mm) {
    return std::nullopt;
  }
  std::optional<model::Estimate> offset_mm = sweep.offset_mm;
  if (!offset_mm) offset_mm = camera->calibration->bench_offset_mm;
  if (!offset_mm || sweep.frames.size() < 2) return std::nullopt;
  const double focus_mm = camera->focus_depth_mm() - offset_mm->value;
  const auto depth_mm = [&](std::size_t i) { return RelativeDepthMm(sweep, sweep.frames[i]); };
  const std::size_t last = sweep.frames.size() - 1;
  if (focus_mm < depth_mm(0) - (depth_mm(1) - depth_mm(0)) ||
      focus_mm > depth_mm(last) + (depth_mm(last) - depth_mm(last - 1))) {
    return std::nullopt;
  }
  std::size_t nearest = 0;
  for (std::size_t i = 1; i <= last; ++i) {
    if (std::abs(depth_mm(i) - focus_mm) < std::abs(depth_mm(nearest) - focus_mm)) nearest = i;
  }
  return nearest;
}

// Chooses at most kShots frames evenly on both sides of `middle`, including both ends.
std::vector<std::size_t> ShotIndices(std::size_t count, std::size_t middle) {
  std::vector<std::size_t> indices;
  constexpr std::size_t kSide = kShots / 2;
  for (std::size_t i = 0; i < kSide; ++i) indices.push_back(middle * i / kSide);
  for (std::size_t i = 0; i <= kSide; ++i) {
    indices.push_back(middle + (count - 1 - middle) * i / kSide);
  }
  indices.erase(std::unique(indices.begin(), indices.end()), indices.end());
  return indices;
}

// Returns the middle of the frame, or of the region of interest, because blur is visible only at
// full size.
cv::Mat MiddleOf(const cv::Mat& frame, const model::RegionOfInterest& roi) {
  constexpr int kMinPx = 128, kMaxPx = 320;
  cv::Rect whole(0, 0, frame.cols, frame.rows);
  if (roi.width > 0) whole &= cv::Rect(roi.x, roi.y, roi.width, roi.height);
  if (whole.empty()) whole = cv::Rect(0, 0, frame.cols, frame.rows);
  const int shorter_px = std::min(whole.width, whole.height);
  const int edge_px = std::min(shorter_px, std::clamp(shorter_px / 4, kMinPx, kMaxPx));
  return frame(cv::Rect(whole.x + (whole.width - edge_px) / 2,
                        whole.y + (whole.height - edge_px) / 2, edge_px, edge_px))
      .clone();
}

SweepStrip ReadSweepStrip(const std::string& path, const std::optional<model::Camera>& camera) {
  std::error_code failure;
  const std::string yaml =
      fs::is_directory(path, failure) ? (fs::path(path) / kSweepName).string() : path;
  std::vector<std::string> notices;
  model::SweepReading reading;
  reading.video_reader = [](const std::string& video, std::vector<std::string>* /*notices*/) {
    return io::VideoFile(video).Survey().frames;
  };
  model::SweepFile sweep = model::ReadSweep(yaml, reading, &notices);
  for (const std::string& notice : notices) spdlog::debug("{}", notice);
  std::stable_sort(sweep.frames.begin(), sweep.frames.end(),
                   [&](const model::SweepFrame& a, const model::SweepFrame& b) {
                     return RelativeDepthMm(sweep, a) < RelativeDepthMm(sweep, b);
                   });
  SweepStrip strip;
  strip.name = path;
  strip.frame_count = static_cast<int>(sweep.frames.size());
  if (sweep.frames.empty()) return strip;
  const std::optional<std::size_t> focus = FrameInFocus(sweep, camera);
  for (std::size_t i :
       ShotIndices(sweep.frames.size(), focus.value_or((sweep.frames.size() - 1) / 2))) {
    ThrowIfCancelled();
    const model::SweepFrame& frame = sweep.frames[i];
    strip.shots.push_back(
        {MiddleOf(io::ReadFrame(frame), sweep.roi), frame.Name(), frame.reading_mm, focus == i});
  }
  return strip;
}

// A record of another run would show wrong numbers beside these images.
EstimateRecord ReadMatchingRecord(const ReportOptions& options,
                                  const model::LightField& light_field) {
  EstimateRecord record = ReadEstimateRecord(options.estimate_path);
  const bool is_part = !options.reading.views.text.empty() || !options.reading.crop.text.empty();
  const bool matches =
      record.u_count == light_field.u_count && record.v_count == light_field.v_count &&
      record.s_count == light_field.s_count && record.t_count == light_field.t_count;
  if (matches || is_part) return record;
  throw Error(
      fmt::format("{}: it is for {}x{} views of {}x{} px, but {} has {}x{} views of {}x{} px: the "
                  "record of its own estimate is expected",
                  options.estimate_path, record.u_count, record.v_count, record.s_count,
                  record.t_count, options.light_field_path, light_field.u_count,
                  light_field.v_count, light_field.s_count, light_field.t_count));
}

// Requires scores of the same area as these views. A record that does not state its area is assumed
// to match.
ComparisonRecord ReadMatchingComparison(const ReportOptions& options,
                                        const model::LightField& light_field) {
  ComparisonRecord record = ReadComparisonRecord(options.comparison_path);
  const bool has_views = record.u_count > 0, has_size = record.s_count > 0;
  const bool matches =
      (!has_views ||
       (record.u_count == light_field.u_count && record.v_count == light_field.v_count)) &&
      (!has_size ||
       (record.s_count == light_field.s_count && record.t_count == light_field.t_count));
  if (matches) return record;
  throw Error(fmt::format(
      "{}: it compares {}x{} views of {}x{} px, but the page shows {}x{} views of {}x{} px of {}: "
      "a comparison of the same views and the same part is expected (--views, --crop)",
      options.comparison_path, record.u_count, record.v_count, record.s_count, record.t_count,
      light_field.u_count, light_field.v_count, light_field.s_count, light_field.t_count,
      options.light_field_path));
}

CommandResult Report(const ReportOptions& options) {
  OutputFile output(options.output_path);
  const model::LightField light_field =
      ReadCropped(options.common, options.light_field_path, options.reading);
  std::optional<model::LightField> truth;
  if (!options.truth_path.empty()) truth = ReadTruth(options, light_field);
  ThrowIfCancelled();

  LightFieldPageInput input;
  input.name = options.light_field_path;
  input.light_field = &light_field;
  input.truth = truth ? &*truth : nullptr;
  std::optional<model::LinearImage> photo;
  if (!options.photo_path.empty()) photo = ReadPhoto(options, light_field);
  input.photo = photo ? &*photo : nullptr;
  if (!options.depth_path.empty()) input.depth = ReadPageDepth(options, light_field);
  if (!options.sweep_path.empty()) {
    input.sweep = ReadSweepStrip(options.sweep_path, light_field.camera);
  }
  if (!options.calibration_path.empty()) {
    input.calibration =
        InlinedCalibrationReport(ReadWholeFile(options.calibration_path), options.calibration_path);
  }
  if (!options.estimate_path.empty()) input.estimate = ReadMatchingRecord(options, light_field);
  if (!options.comparison_path.empty()) {
    input.comparison = ReadMatchingComparison(options, light_field);
  }
  input.version = Version();
  input.date = NowIso8601();
  input.threads = options.common.threads;
  ThrowIfCancelled();

  const LightFieldPage page = MakeLightFieldPage(input);
  ThrowIfCancelled();
  output.Commit(page.html);
  PrintResult(options.common,
              fmt::format("{}: {}\n", options.output_path, fmt::join(page.sections, ", ")));
  return {{{"status", "ok"},
           {"reason", ""},
           {"output", options.output_path},
           {"sections", page.sections}},
          "",
          true};
}

void CheckUsage(const ReportOptions& options) {
  LightFieldReadOptionsOf(options.reading);
  const DepthOptions& depth = options.depth;
  if (!options.depth_path.empty()) {
    ConventionOf(depth);
  } else if (!depth.kind.empty() || !depth.unit.empty() || depth.disparity_scale != 1 ||
             depth.disparity_offset_px != 0) {
    throw UsageError("--depth-kind, --depth-unit and --disparity-... require --depth");
  }
}

void AddFileOptions(CLI::App* command, ReportOptions* options) {
  command->add_option("light-field", options->light_field_path, "Estimated light field")
      ->required()
      ->type_name("LF");
  command->add_option("-o,--output", options->output_path, "Page to write")
      ->required()
      ->type_name("PAGE.html");
  command->add_option("--photo", options->photo_path, "Photograph that it was estimated from")
      ->type_name("IMAGE");
  command->add_option("--depth", options->depth_path, "Depth map of the photograph")
      ->type_name("DEPTH");
  AddDepthOptions(command, "Required with --depth", &options->depth);
  command
      ->add_option("--truth", options->truth_path,
                   "True light field; if it has more views, the inner ones are used")
      ->type_name("TRUE_LF");
  command
      ->add_option("--sweep", options->sweep_path,
                   "Focus sweep that the camera was calibrated with")
      ->type_name("SWEEP");
  command
      ->add_option(
          "--calibration", options->calibration_path,
          "Page that thicklens calibrate --report has written: index.html in its folder, or "
          "report.html of an older version")
      ->type_name("PAGE.html");
  command
      ->add_option("--estimate", options->estimate_path, "JSON file of thicklens estimate --json")
      ->type_name("ESTIMATE.json");
  command
      ->add_option("--comparison", options->comparison_path,
                   "JSON file of thicklens compare --json")
      ->type_name("COMPARE.json");
}

}  // namespace

void AddReportCommand(CLI::App* program, CommandAction* action) {
  CLI::App* command = program->add_subcommand(
      "report", "Make one page that shows a light field and the data it was made from");
  const auto options = std::make_shared<ReportOptions>();
  AddFileOptions(command, options.get());
  AddReadingOptions(command, &options->reading);
  AddCommonOptions(command, &options->common);
  command->callback([options, action] {
    *action = [options] {
      CheckUsage(*options);
      RequireDistinctFiles({options->common.json_path, options->output_path},
                           {options->light_field_path, options->photo_path, options->depth_path,
                            options->truth_path, options->sweep_path, options->calibration_path,
                            options->estimate_path, options->comparison_path});
      RunCommand(options->common, [&] { return Report(*options); });
    };
  });
}

}  // namespace thicklens::tools
