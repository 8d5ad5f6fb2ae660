#ifndef THICKLENS_TOOLS_TARGET_PAGE_H_
#define THICKLENS_TOOLS_TARGET_PAGE_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/model/camera.h"

namespace thicklens::tools {

// Size of a sheet of paper.
struct SheetSize {
  double width_mm = 0;
  double height_mm = 0;
  bool may_turn = false;  // upright or lying, whichever holds the pattern
};

// What the camera sees of a target at a distance.
struct CameraView {
  double distance_mm = 0;
  double px_mm = 0;  // what one px covers on the target
  double width_mm = 0;
  double height_mm = 0;
  double focal_length_mm = 0;
};
// Of the camera focused on a target at `distance_mm` from its aperture. Throws Error if it cannot
// be focused there.
CameraView ViewOfTarget(const model::Camera& camera, double distance_mm);

struct TargetRequest {
  SheetSize sheet;
  std::optional<double> feature_mm;  // diameter of the smallest disc; absent: chosen
  double finest_mm = 0.1;            // smallest feature that the print method resolves
  double edge_angle_deg = 5;         // from the vertical; positive: the upper end leans right
  bool two_tone = false;             // black and white alone
  std::uint64_t seed = 1;
  std::optional<CameraView> view;
};

// On the sheet, mm from its top left corner, y down.
struct Rectangle {
  double x = 0, y = 0, width = 0, height = 0;
};

// A calibration target before it is drawn: a texture, in its middle a patch with an edge, below it
// a bar of exact length and a few lines that say what the sheet is.
struct TargetPage {
  double width_mm = 0;
  double height_mm = 0;
  Rectangle pattern;
  Rectangle patch;  // black on the left of the edge, white on its right
  double edge_angle_deg = 0;
  Rectangle bar;
  std::vector<std::string> caption;
  double text_size_mm = 0;         // of the letters' em square
  double first_baseline_y_mm = 0;  // lines are kLineHeight text sizes apart
  double feature_mm = 0;
  bool two_tone = false;
  std::uint64_t seed = 0;
  std::string choice;  // what was chosen and why, in one line

  // Where the edge crosses the height y: x = centre - (y - centre) tan(angle), mm.
  double EdgeX(double y_mm) const;
};
constexpr double kLineHeight = 1.4;

// Throws Error with the reason where there is no such page: a field that does not fit the sheet,
// features that the print method does not resolve, a sheet without room.
TargetPage LayOutTarget(const TargetRequest& request);

}  // namespace thicklens::tools

#endif  // THICKLENS_TOOLS_TARGET_PAGE_H_
