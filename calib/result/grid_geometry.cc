#include "thicklens/calib/grid_geometry.h"

#include <fmt/format.h>

namespace thicklens::calib {
namespace {

std::string WithSigma(const model::Estimate& value, const char* unit) {
  return fmt::format("{:.6g} +- {:.2g}{}", value.value, value.sigma, unit);
}

}  // namespace

std::vector<std::string> GridGeometry::InWords() const {
  std::vector<std::string> lines;
  if (!done) {
    if (message != "not run") lines.push_back(message);
    return lines;
  }
  lines.push_back(fmt::format(
      "{}: found in {} of {} frames{}, {} points, residual {:.3f} px rms", grid, frames_used,
      frames_searched,
      views_searched > 0 ? fmt::format(" and {} of {} further views", views_used, views_searched)
                         : "",
      points, rms_px));
  if (!message.empty()) lines.push_back(message);
  if (focal_length_px) {
    std::string line = "image distance " + WithSigma(*focal_length_px, " px");
    if (image_distance_mm) line += ", that is d1 = " + WithSigma(*image_distance_mm, " mm");
    lines.push_back(line);
  }
  if (principal_x_px && principal_y_px)
    lines.push_back(fmt::format("principal point ({}, {}) px", WithSigma(*principal_x_px, ""),
                                WithSigma(*principal_y_px, "")));
  if (tilt_right_deg && tilt_down_deg)
    lines.push_back(fmt::format(
        "target turned by {} about the vertical axis (positive: right side nearer) and by {} about "
        "the horizontal one (positive: bottom nearer)",
        WithSigma(*tilt_right_deg, " degrees"), WithSigma(*tilt_down_deg, " degrees")));
  for (const GridCombination& combination : combinations)
    lines.push_back(combination.name + " = " + WithSigma(combination.value, ""));
  for (const std::string& direction : open)
    lines.push_back("left open, and changing together: " + direction);
  if (!verdict.empty()) lines.push_back(verdict);
  return lines;
}

}  // namespace thicklens::calib
