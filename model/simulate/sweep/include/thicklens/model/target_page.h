#ifndef THICKLENS_MODEL_TARGET_PAGE_H_
#define THICKLENS_MODEL_TARGET_PAGE_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/target_grid.h"

namespace thicklens::model {

// Size of a sheet of paper.
struct SheetSize {
  double width_mm = 0;    // width, mm
  double height_mm = 0;   // height, mm
  bool may_turn = false;  // portrait or landscape, whichever holds the pattern
};

// The field that the camera sees of a target at a distance.
struct CameraView {
  double distance_mm = 0;      // from the aperture to the target, mm
  double px_mm = 0;            // size of one px on the target
  double width_mm = 0;         // width of the field on the target, mm
  double height_mm = 0;        // height of the field on the target, mm
  double focal_length_mm = 0;  // f1 of the camera, mm
};
// Returns the view of the camera focused on a target at `distance_mm` from its aperture. Throws
// Error if it cannot be focused there.
THICKLENS_EXPORT CameraView ViewOfTarget(const Camera& camera, double distance_mm);

// The conditions that a target must fulfil.
struct TargetRequest {
  SheetSize sheet;                   // paper on which it is printed
  std::optional<double> feature_mm;  // diameter of the smallest disc; absent: chosen automatically
  double finest_mm = 0.1;            // smallest feature that the print method resolves
  double edge_angle_deg = 5;         // from the vertical; positive: the upper end leans right
  bool two_tone = false;             // only black and white
  std::uint64_t seed = 1;            // of the texture
  std::optional<TargetGrid> grid;    // drawn in place of texture and edge; absent: texture
  bool has_marks = true;             // marks at the corners of a texture, where there is room
  std::optional<CameraView> view;    // the field that the pattern must fill; absent: no camera
};

// A rectangle on the sheet, mm from its top left corner, y down.
struct SheetRectangle {
  double x = 0, y = 0, width = 0, height = 0;  // top left corner, and size, mm
};

// A mark of the sheet.
struct PlacedMark {
  int number = 0;       // of kSheetDictionary
  SheetRectangle area;  // its black square
};

// A calibration target before it is drawn: a texture, a patch with an edge in its middle, and below
// it a bar of exact length and a few lines that describe the sheet.
struct TargetPage {
  double width_mm = 0;               // width of the sheet, mm
  double height_mm = 0;              // height of the sheet, mm
  SheetRectangle pattern;            // where the texture is
  SheetRectangle patch;              // black on the left of the edge, white on its right
  double edge_angle_deg = 0;         // from the vertical; positive: the upper end leans right
  std::optional<TargetGrid> grid;    // in `pattern`, in place of texture and edge
  std::vector<PlacedMark> marks;     // at the corners of a texture, or none
  SheetRectangle bar;                // the bar of exact length
  std::vector<std::string> caption;  // lines that describe the sheet
  double text_size_mm = 0;           // size of the letters' em square
  double first_baseline_y_mm = 0;    // lines are kLineHeight text sizes apart
  double feature_mm = 0;             // diameter of the smallest disc, mm
  bool two_tone = false;             // only black and white
  std::uint64_t seed = 0;            // of the texture
  std::string choice;                // the choices and their reasons, in one line

  // Position of the edge at the height y: x = centre - (y - centre) tan(angle), mm.
  THICKLENS_EXPORT double EdgeX(double y_mm) const;
};
constexpr double kLineHeight = 1.4;  // Distance of the caption's baselines, in text sizes.

// Throws Error with the reason if no such page exists: the field does not fit the sheet, the print
// method does not resolve the features, or the sheet has no room.
THICKLENS_EXPORT TargetPage LayOutTarget(const TargetRequest& request);

}  // namespace thicklens::model

#endif  // THICKLENS_MODEL_TARGET_PAGE_H_
