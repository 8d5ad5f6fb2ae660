#include "tools/report/grid_words.h"

#include <fmt/format.h>

#include <optional>

#include "thicklens/base/printable_text.h"
#include "tools/report/distortion_words.h"

namespace thicklens::tools {
namespace {

nlohmann::json WithSigmaJson(const std::optional<model::Estimate>& value) {
  if (!value) return nullptr;
  return {{"value", value->value}, {"sigma", value->sigma}};
}

nlohmann::json ScalesJson(const std::vector<calib::GridScale>& scales) {
  nlohmann::json rows = nlohmann::json::array();
  for (const calib::GridScale& scale : scales) {
    rows.push_back({{"reading_mm", scale.reading_mm},
                    {"magnification", {{"value", scale.magnification}, {"sigma", scale.sigma}}}});
  }
  return rows;
}

std::string MeasuredWords(const model::Estimate& value, const char* unit) {
  return fmt::format("{:.4g} +- {:.2g}{}", value.value, value.sigma, unit);
}

}  // namespace

std::vector<std::string> GridLines(const calib::GridGeometry& grid) {
  std::vector<std::string> lines = grid.InWords();
  for (std::string& line : lines) line = PrintableUtf8(line);
  return lines;
}

std::string MarksLine(const calib::Calibration& calibration) {
  const calib::SheetMarks& marks = calibration.diagnostics.marks;
  if (!marks.done) return "";
  std::string line =
      fmt::format("{} marks of {:g} mm in {} frame(s)", marks.marks, marks.side_mm, marks.frames);
  if (!marks.scales.empty())
    line += fmt::format(", magnification {} at the reading {:.5g} mm",
                        MeasuredWords({marks.scales[0].magnification, marks.scales[0].sigma}, ""),
                        marks.scales[0].reading_mm);
  if (marks.tilt_right_deg && marks.tilt_down_deg) {
    line += fmt::format(
        "; target turned by {} about the vertical axis (positive: right side nearer) "
        "and by {} about the horizontal one (positive: bottom nearer)",
        MeasuredWords(*marks.tilt_right_deg, " degrees"),
        MeasuredWords(*marks.tilt_down_deg, " degrees"));
  }
  return line;
}

nlohmann::json GridJson(const calib::GridGeometry& grid) {
  if (grid.message == "not run") return nullptr;
  nlohmann::json combinations = nlohmann::json::array();
  for (const calib::GridCombination& of : grid.combinations) {
    combinations.push_back(
        {{"name", of.name}, {"value", of.value.value}, {"sigma", of.value.sigma}});
  }
  return {{"done", grid.done},
          {"message", PrintableUtf8(grid.message)},
          {"grid", grid.grid},
          {"frames_searched", grid.frames_searched},
          {"frames_used", grid.frames_used},
          {"views_searched", grid.views_searched},
          {"views_used", grid.views_used},
          {"points", grid.points},
          {"rms_px", grid.rms_px},
          {"follows_readings", grid.follows_readings},
          {"scales", ScalesJson(grid.scales)},
          {"focal_length_px", WithSigmaJson(grid.focal_length_px)},
          {"image_distance_mm", WithSigmaJson(grid.image_distance_mm)},
          {"principal_point_x_px", WithSigmaJson(grid.principal_x_px)},
          {"principal_point_y_px", WithSigmaJson(grid.principal_y_px)},
          {"tilt_right_deg", WithSigmaJson(grid.tilt_right_deg)},
          {"tilt_down_deg", WithSigmaJson(grid.tilt_down_deg)},
          {"combinations", combinations},
          {"open", grid.open},
          {"distortion", DistortionJson(grid.lens)},
          {"largest_shift_px",
           {{"value", grid.largest_shift_px.value}, {"sigma", grid.largest_shift_px.sigma}}},
          {"chi2_of_distortion", grid.chi2_of_distortion},
          {"held_out_without_px", grid.held_out_without_px},
          {"held_out_with_px", grid.held_out_with_px},
          {"distortion_is_found", grid.distortion_is_found},
          {"distortion_is_used", grid.distortion_is_used},
          {"verdict", grid.verdict}};
}

nlohmann::json MarksJson(const calib::SheetMarks& marks) {
  if (!marks.done) return nullptr;
  return {{"frames", marks.frames},
          {"marks", marks.marks},
          {"side_mm", marks.side_mm},
          {"scales", ScalesJson(marks.scales)},
          {"tilt_right_deg", WithSigmaJson(marks.tilt_right_deg)},
          {"tilt_down_deg", WithSigmaJson(marks.tilt_down_deg)}};
}

}  // namespace thicklens::tools
