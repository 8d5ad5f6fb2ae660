#ifndef THICKLENS_CALIB_TARGET_FINDING_H_
#define THICKLENS_CALIB_TARGET_FINDING_H_

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "thicklens/base/export.h"
#include "thicklens/model/camera.h"
#include "thicklens/model/sweep_file.h"

namespace thicklens::calib {

// Points (pinholes or beads) that were followed through the sweep.
struct SpotFinding {
  bool done = false;                // true if enough points were followed
  std::string message = "not run";  // how it ended; without a result, the reason
  bool are_bright = false;          // true: bright points on a dark ground
  int found = 0;                    // points in the sharp frames
  int used = 0;                     // of them, those with a blur in enough frames
  int measured = 0;                 // measurements of one point in one frame
  // Reasons for which measurements of a point in a frame were left out, with their counts.
  std::vector<std::pair<std::string, int>> left_out;
};

// One of the depths of a target with relief.
struct ReliefPart {
  // Distance from the measured part along the axis, mm, with its standard deviation: positive where
  // the part is nearer to the camera.
  model::Estimate nearer_mm;
  double share = 0;  // of the zones that came into focus, 0 to 1
};

// Depths of a target, from the readings at which zones of the field are sharpest.
struct ReliefFinding {
  bool measured = false;            // true if enough zones came into focus
  std::string message = "not run";  // how it ended; without a result, the reason
  bool is_relief = false;           // true: several depths describe the zones, a smooth field none
  int columns = 0, rows = 0;        // size of the grid of zones
  // Reading at which each zone is sharpest, mm, row by row; absent where it has no such peak.
  std::vector<std::optional<model::Estimate>> sharpest_mm;
  std::vector<int> part_of_zone;  // index into `parts` of each zone; -1: none of them
  std::vector<ReliefPart> parts;  // the measured part, or the largest one, is the first
  // The rectangle within the first part on which the calibration was repeated, px of the frames;
  // absent where no rectangle sufficed.
  std::optional<model::RegionOfInterest> region;
  double region_share = 0;  // its area over that of the region of interest
};

// Findings about the target of a sweep.
struct TargetFinding {
  // How the blur was measured: "texture", "edges", "points"; empty: it was not.
  std::string measured_as;
  SpotFinding spots;     // of points
  ReliefFinding relief;  // depths of the zones of the field

  // The zones as a map of letters, one line for each row of zones: "a" for the first part, "b" for
  // the second, "." where a zone belongs to none of them.
  THICKLENS_EXPORT std::string ReliefMap() const;
};

}  // namespace thicklens::calib

#endif  // THICKLENS_CALIB_TARGET_FINDING_H_
