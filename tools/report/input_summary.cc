#include "tools/report/input_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/error.h"
#include "thicklens/base/printable_text.h"
#include "thicklens/calib/calibrate.h"
#include "thicklens/calib/focus_sweep.h"
#include "thicklens/calib/frame_correction.h"
#include "thicklens/model/conjugates.h"
#include "thicklens/opencv.h"
#include "tools/report/distortion_words.h"

namespace thicklens::tools {
namespace {

// Returns the depths of the nearest and the farthest frame, if the offset is known.
std::optional<std::pair<double, double>> DepthRangeMm(const Sweep& sweep,
                                                      const Understanding& found) {
  if (!sweep.description.offset_mm) return std::nullopt;
  const double sign = model::DirectionSign(sweep.description.direction);
  return std::minmax(sweep.description.offset_mm->value + sign * found.min_reading_mm,
                     sweep.description.offset_mm->value + sign * found.max_reading_mm);
}

std::string EstimateText(const std::optional<model::Estimate>& estimate, const char* unit) {
  if (!estimate) return "unknown";
  if (!(estimate->sigma > 0)) return fmt::format("{:.6g} {}", estimate->value, unit);
  return fmt::format("{:.6g} +- {:.2g} {}", estimate->value, estimate->sigma, unit);
}

std::string FloorText(const model::FloorKnowledge& floor) {
  if (floor.from_px) return fmt::format("{:.4g} to {:.4g} px", *floor.from_px, *floor.to_px);
  return EstimateText(floor.given_px, "px");
}

// A statement about the plane of focus as it was stated, and the depth that it gives.
struct FocusLine {
  std::string name, unit;
  model::Estimate value, depth_mm;
  bool is_depth = false;  // the statement is the depth itself
};

std::vector<FocusLine> FocusLinesOf(const Sweep& sweep) {
  std::vector<FocusLine> lines;
  const auto stated_focus = calib::MakeFocusSweep(sweep.description, sweep.camera).stated_focus;
  for (const model::StatedConjugate& stated : stated_focus) {
    // A working distance is the only statement that was converted.
    const bool is_converted = stated.name == "working_distance_mm";
    lines.push_back({stated.name, stated.kind == model::ConjugateKind::kMagnification ? "" : " mm",
                     is_converted ? sweep.description.working_distance_mm.value() : stated.value,
                     model::FocusDepthOf(sweep.camera.lens, stated),
                     stated.kind == model::ConjugateKind::kFocusDepth && !is_converted});
  }
  return lines;
}

std::string FocusText(const Sweep& sweep) {
  std::string text;
  for (const FocusLine& line : FocusLinesOf(sweep)) {
    text +=
        fmt::format("{:<10} {} {:.6g}", text.empty() ? "focus" : "", line.name, line.value.value);
    if (line.value.sigma > 0) text += fmt::format(" +- {:.2g}", line.value.sigma);
    text += line.unit;
    if (!line.is_depth)
      text += fmt::format(": in focus at {} from the aperture", EstimateText(line.depth_mm, "mm"));
    text += "\n";
  }
  return text;
}

std::string ObjectiveText(const std::optional<model::Objective>& objective) {
  if (!objective) return "";
  return fmt::format(
      "           the equivalent lens of an objective {:.6g}x, numerical aperture {:.6g}, tube "
      "lens "
      "{:.6g} mm\n",
      objective->magnification, objective->numerical_aperture,
      objective->tube_lens_focal_length_mm);
}

std::string CameraText(const model::Camera& camera) {
  const model::ThickLens& lens = camera.lens;
  return fmt::format(
      "camera     {}: f1 {:.6g} mm, f2 {:.6g} mm, thickness {:.6g} mm, aperture radius {:.6g} mm\n"
      "{}           {} x {} px of {:.6g} mm, principal point ({:.6g}, {:.6g}) px, {}, PSF {}\n",
      PrintableUtf8(camera.name), lens.front_focal_length_mm, lens.rear_focal_length_mm,
      lens.lens_thickness_mm, lens.aperture_radius_mm, ObjectiveText(camera.objective),
      camera.sensor.width_px, camera.sensor.height_px, camera.sensor.pixel_pitch_mm,
      camera.sensor.principal_point_px.x(), camera.sensor.principal_point_px.y(),
      camera.sensor.transfer.Name(), model::PsfName(camera.psf));
}

std::string BenchText(const Sweep& sweep, const Understanding& found) {
  const auto depths = DepthRangeMm(sweep, found);
  return fmt::format(
             "readings   {:.6g} to {:.6g} mm, {} distinct, step {:.4g} mm (median), {}\n"
             "bench      direction {}, offset {}\n"
             "depths     {}\n",
             found.min_reading_mm, found.max_reading_mm, found.distinct_readings,
             found.median_step_mm,
             sweep.description.reading_sigma_stated
                 ? fmt::format("sigma {:.3g} mm", sweep.description.reading_sigma_mm)
                 : std::string("sigma not stated"),
             model::BenchDirectionName(sweep.description.direction),
             EstimateText(sweep.description.offset_mm, "mm"),
             depths ? fmt::format("{:.6g} to {:.6g} mm from the aperture", depths->first,
                                  depths->second)
             : FocusLinesOf(sweep).empty()
                 ? "unknown until the offset is estimated from the image scale"
                 : "unknown until the frames are measured") +
         FocusText(sweep);
}

std::string PeriodText(const model::SweepFile& description) {
  if (description.target_grid) {
    return ", " + description.target_grid->Description() +
           (description.grid_views.empty()
                ? ""
                : fmt::format(", {} further views", description.grid_views.size()));
  }
  if (!description.target_period_mm) return "";
  return fmt::format(", period {:.6g} mm", *description.target_period_mm);
}

nlohmann::json StatedFocusJson(const Sweep& sweep) {
  nlohmann::json list = nlohmann::json::array();
  for (const FocusLine& line : FocusLinesOf(sweep)) {
    list.push_back(
        {{"name", line.name},
         {"value", line.value.value},
         {"sigma", line.value.sigma},
         {"focus_depth_mm", {{"value", line.depth_mm.value}, {"sigma", line.depth_mm.sigma}}}});
  }
  return list;
}

}  // namespace

Understanding Understand(const Sweep& sweep) {
  const calib::FocusSweep focus_sweep = FocusSweepOf(sweep);
  std::string why;
  if (!focus_sweep.IsValid(&why)) throw Error(fmt::format("{}: {}", sweep.description.source, why));
  if (!calib::HasEnoughFrames(focus_sweep, &why))
    throw Error(fmt::format("{}: {}", sweep.description.source, why));
  const cv::Mat first = focus_sweep.read_frame(0);
  calib::LinearGrey(first, focus_sweep, 0);
  std::set<double> readings;
  for (const model::SweepFrame& frame : sweep.description.frames) readings.insert(frame.reading_mm);
  std::multiset<double> steps;
  for (auto reading = std::next(readings.begin()); reading != readings.end(); ++reading)
    steps.insert(*reading - *std::prev(reading));
  return {
      first.size(),       first.depth() == CV_8U ? 8 : 16,
      first.channels(),   *readings.begin(),
      *readings.rbegin(), *std::next(steps.begin(), static_cast<std::ptrdiff_t>(steps.size() / 2)),
      readings.size()};
}

std::string ReadingsLine(const Sweep& sweep) {
  const std::string& readings = sweep.description.readings;
  return readings.empty() ? "" : fmt::format("read from  {}\n", PrintableUtf8(readings));
}

std::string CorrectionText(const Sweep& sweep) {
  std::string text;
  for (const std::string& line : sweep.correction_lines)
    text += fmt::format("{:<10} {}\n", text.empty() ? "corrected" : "", PrintableUtf8(line));
  if (sweep.camera.distortion)
    text += fmt::format("distortion {}\n", DistortionWords(*sweep.camera.distortion));
  return text;
}

nlohmann::json CorrectionJson(const Sweep& sweep) {
  if (sweep.correction == nullptr) return nullptr;
  const calib::FrameCorrection& correction = *sweep.correction;
  nlohmann::json lines = nlohmann::json::array();
  for (const std::string& line : sweep.correction_lines) lines.push_back(PrintableUtf8(line));
  return {{"lines", lines},
          {"dark", !correction.dark().empty()},
          {"flat", !correction.gain().empty()},
          {"interpolated_pixels", correction.defect_count()},
          {"without_flat_light", correction.unlit_count()}};
}

std::string UnderstandingText(const Sweep& sweep, const Understanding& found,
                              const std::string& method, const std::string& outputs) {
  const model::RegionOfInterest& roi = sweep.description.roi;
  return fmt::format(
      "frames     {} (the first one has {} x {} px, {} bit, {} channel{})\n{}{}{}"
      "region     {}\n"
      "target     {}{}, blur floor {}\n"
      "method     {}\n"
      "output     {}\n"
      "dry run: nothing was measured\n",
      sweep.description.frames.size(), found.frame_size_px.width, found.frame_size_px.height,
      found.frame_bits, found.frame_channels, found.frame_channels == 1 ? "" : "s",
      CorrectionText(sweep) + ReadingsLine(sweep), BenchText(sweep, found),
      CameraText(sweep.camera),
      roi.width > 0 ? fmt::format("{} x {} px from ({}, {})", roi.width, roi.height, roi.x, roi.y)
                    : "the whole field",
      model::SweepTargetName(sweep.description.target), PeriodText(sweep.description),
      FloorText(sweep.description.floor),
      sweep.description.raw == model::SweepRaw::kGreen
          ? method + ", on the green sites of raw files"
          : method,
      outputs);
}

nlohmann::json UnderstandingJson(const Sweep& sweep, const Understanding& found,
                                 const std::string& method) {
  nlohmann::json json = {
      {"status", "ok"},
      {"reason", ""},
      {"dry_run", true},
      {"method", method},
      {"camera", sweep.camera.name},
      {"frames", sweep.description.frames.size()},
      {"readings", PrintableUtf8(sweep.description.readings)},
      {"width_px", found.frame_size_px.width},
      {"height_px", found.frame_size_px.height},
      {"bits", found.frame_bits},
      {"channels", found.frame_channels},
      {"min_reading_mm", found.min_reading_mm},
      {"max_reading_mm", found.max_reading_mm},
      {"median_step_mm", found.median_step_mm},
      {"distinct_readings", found.distinct_readings},
      {"reading_sigma_mm", sweep.description.reading_sigma_stated
                               ? nlohmann::json(sweep.description.reading_sigma_mm)
                               : nlohmann::json(nullptr)},
      {"direction", model::BenchDirectionName(sweep.description.direction)},
      {"target", model::SweepTargetName(sweep.description.target)},
      {"raw", model::SweepRawName(sweep.description.raw)},
      {"correction", CorrectionJson(sweep)},
      {"distortion", DistortionJson(sweep.camera.distortion)},
      {"stated_focus", StatedFocusJson(sweep)},
      {"target_period_mm", nullptr},
      {"target_grid", nullptr},
      {"grid_views", sweep.description.grid_views.size()},
      {"offset_mm", nullptr},
      {"depth_range_mm", nullptr}};
  if (sweep.description.offset_mm) {
    json["offset_mm"] = {{"value", sweep.description.offset_mm->value},
                         {"sigma", sweep.description.offset_mm->sigma}};
  }
  if (sweep.description.target_grid)
    json["target_grid"] = sweep.description.target_grid->Description();
  if (sweep.description.target_period_mm)
    json["target_period_mm"] = *sweep.description.target_period_mm;
  if (const auto depths = DepthRangeMm(sweep, found))
    json["depth_range_mm"] = {depths->first, depths->second};
  return json;
}

}  // namespace thicklens::tools
